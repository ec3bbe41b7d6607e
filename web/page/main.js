/** The page: its elements, and what happens between them. */

import { LightPanel } from "./view/lightPanel.js";
import { Marking, NO_HINTS } from "./view/marking.js";
import { ObjectTools } from "./view/objectTools.js";
import { PhotoStage } from "./view/photoStage.js";
import { StagesPanel } from "./view/stagesPanel.js";
import { element, listenForPhotos, setStatus, sendLight, showFetched } from "./view/elements.js";
import { ProbeOpener } from "./probe.js";
import { LiveSession } from "./live/session.js";
import { lookAtGiven } from "../src/photo/maskCheck.js";
import { maskFromAlpha, objectBox } from "../src/photo/picture.js";
import { openPhoto } from "./openPhoto.js";
import { PAGE, errorLine, sentence } from "./words.js";
import { fetchExample, readExample } from "./example.js";
import { showQuality, untold } from "./view/maskQuality.js";

const config = await (await fetch("config.json")).json();
if (config.server && !["localhost", "127.0.0.1", "[::1]"].includes(location.hostname)) {
  element("private").textContent = "Photos stay in this browser; HEIC and exports go to the machine that serves this page.";
}
const stage = new PhotoStage();
const networks = new ProbeOpener(config, showDownload, stage.stage.isSoftware ? 1 : 0); // software then draws
const tools = new ObjectTools(stage);
const light = new LightPanel(config);
const stages = new StagesPanel();
const marking = new Marking(
  {
    canvas: element("mask"),
    cursor: element("cross"),
    removing: element("removing"),
    band: element("band"),
    button: element("draw-box"),
  },
  stage,
  (hints) => (live.running ? live.mark(hints) : remask(hints)),
);
const surroundings = element("surroundings");
const options = () => ({
  surroundings: surroundings.value,
  pitchDeg: (live.running ? live : state.opened).pitchDeg,
});

/** Of an object that is not found: no mask with its box and what it was found by, no light. */
const NOTHING = { mask: null, box: null, hints: NO_HINTS, found: null, result: null };

/** The photo on show, and what is under way for it; the camera's is in LiveSession. */
const state = {
  /** The picture, its field of view and name; of its object and light what there is; the given pitch. Null before the first. */
  opened: null,
  /** Of a picture or the camera: one that is ready after another was chosen is dropped. */
  choice: 0,
  /** Of questions about the picture on show: older answers are dropped. */
  turn: 0,
  /** Ends the search of a mask that is no longer wanted. @type {AbortController | null} */
  searching: null,
  /** The status line to go back to after a file that was still needed has come. @type {string | null} */
  doing: null,
  /** The file that is on its way. @type {string | null} */
  fetched: null,
  /** Of the estimate that a change of the pitch asks for. */
  pitchTimer: undefined,
};

/** One line a file with a bar, and one where it stalls; lines of the camera stay once it is followed. */
function showDownload({ file, loaded, total, stalled }) {
  const size = total ? ` of ${(total / 1e6).toFixed(1)}` : "";
  if (stalled) setStatus(`Waiting for ${file}: ${(loaded / 1e6).toFixed(1)}${size} MB have come. Check the connection.`);
  else if (!live.following) {
    if (file !== state.fetched) setStatus(`Fetching ${file}${total ? `, ${(total / 1e6).toFixed(1)} MB` : ""} …`);
    showFetched(loaded, total);
    if (state.doing && loaded === total) setStatus(state.doing);
  }
  state.fetched = stalled ? null : file;
}

const live = new LiveSession({
  networks,
  config,
  stage,
  light,
  stages,
  marking,
  options,
  onShown: () => {
    state.turn++;
    state.searching?.abort();
    showQuality(null);
    light.clear();
    stages.clear();
  },
  onMask: showQuality,
  onFault: (error) => {
    showAgain();
    setStatus(errorLine(error), "fault");
  },
});

/** Of the photo on show; less than what is said of a camera that is being opened. */
function tell(...given) {
  if (!live.opening) setStatus(...given);
}

/**
 * Show a photo; find its object; estimate. What was on show stays until the photo is decoded.
 *
 * @param {Blob | Promise<Blob>} blob
 * @param {string} name
 * @param {import("../types/index.d.ts").Hints} [hints] in its pixels
 */
async function open(blob, name, hints) {
  const mine = ++state.choice;
  setStatus("Opening the photo …");
  const found = await openPhoto(await blob, name, config.server);
  if (mine !== state.choice) return;
  put(found);
  await (hints ? remask({ ...NO_HINTS, ...hints }) : examine(ownMask));
}

/** A picture in the place of another or of the camera's. */
function put(found) {
  live.stop();
  state.searching?.abort();
  state.turn++;
  state.opened = { ...NOTHING, ...found };
  showOpened();
}

function showOpened() {
  const { picture, mask, found, result } = state.opened;
  stage.showPicture(picture);
  marking.open(picture);
  if (mask) showOutline();
  showQuality(found);
  if (result) return showLight();
  light.clear();
  stages.clear();
}

/** What was found of the object on show, and by which marks. */
function showOutline() {
  const { picture, mask, hints } = state.opened;
  marking.show(mask && { ...picture, data: mask }, hints);
}

/** The opened picture where the camera's has ended. */
function showAgain() {
  if (state.opened && !stage.video.hidden) showOpened();
}

/** The picture's own transparency or the mask network's proposal; null without both: then a click is needed. */
async function ownMask(picture, isLate) {
  const own = maskFromAlpha(picture);
  if (own) {
    const { mask, warnings } = lookAtGiven(own, picture.width);
    return { data: mask, quality: null, notices: warnings };
  }
  const probe = await networks.open();
  return probe.hasMask ? findMask(picture, marking.hints, isLate) : null;
}

function remask(hints) {
  return examine((picture, isLate) => findMask(picture, hints, isLate), hints);
}

async function findMask(picture, hints, isLate) {
  const probe = await networks.open();
  if (isLate()) return null;
  state.searching?.abort();
  state.searching = new AbortController();
  state.doing = "Finding the object …";
  tell(state.doing);
  try {
    return await probe.mask(picture, { ...hints, signal: state.searching.signal });
  } finally {
    if (!isLate()) state.doing = null;
  }
}

/**
 * Find the object of the picture on show, by what was marked, and its light. What comes or fails after something newer was
 * asked is dropped.
 */
async function examine(maskOf, hints = NO_HINTS) {
  const mine = ++state.turn;
  const isLate = () => mine !== state.turn;
  try {
    const found = await maskOf(state.opened.picture, isLate);
    if (!isLate()) await estimate(found, hints, isLate);
  } catch (error) {
    if (isLate()) return;
    showOutline();
    if (!state.opened.result) hideLight();
    tell(errorLine(error), "fault");
  }
}

async function estimate(found, hints, isLate) {
  const { picture, longFovDeg, lensDeg } = state.opened;
  const mask = found?.data ?? null;
  const box = mask && objectBox(mask, picture.width);
  if (!box && state.opened.mask) return stay(found?.notices[0], isLate);
  marking.show(mask && { ...picture, data: mask }, box ? hints : NO_HINTS);
  showQuality(box ? found : null);
  if (!box) return showNothing(found?.notices[0]);
  const { seconds, ...kept } = found;
  Object.assign(state.opened, { mask, box, hints, found: kept, result: null });
  const probe = await networks.open();
  if (isLate()) return;
  tell("Estimating the lighting …");
  const result = await probe.examine({ picture, mask, longFovDeg, isLensKnown: lensDeg !== null, options: options() });
  if (isLate()) return;
  state.opened.result = result;
  showLight();
  const doubt = untold(found, result.light);
  if (doubt) return tell(`Estimated, but ${PAGE.line(doubt)}.`, "warning");
  const search = seconds === undefined ? "" : `object found in ${seconds.toFixed(1)} s, `;
  tell(`Estimated: ${search}light in ${result.seconds.toFixed(1)} s. If the outline is wrong, click on the object, or draw a box around it.`);
}

/** What was marked found nothing: the last object and its light stay, the mark does not. */
async function stay(why, isLate) {
  const { hints, found, result } = state.opened;
  if (result) showOutline();
  else await estimate(found, hints, isLate); // its light was on its way
  if (!isLate()) tell(`${sentence(why)} The last object and its light stay: click on the object, or draw a box around it.`, "warning");
}

/** Nothing of the last light is left. @param {string} [why] where it was looked for */
function showNothing(why) {
  Object.assign(state.opened, NOTHING);
  hideLight();
  const advice = "Click on the object, or draw a box around it.";
  setStatus(why ? `${sentence(why)} ${advice}` : advice, why ? "warning" : "");
}

/** The picture alone. */
function hideLight() {
  stage.showPicture(state.opened.picture);
  light.clear();
  stages.clear();
}

function showLight() {
  const { picture, longFovDeg, lensDeg, name, mask, box, result, pitchDeg } = state.opened;
  const ground = pitchDeg === undefined ? result.light.ground : { pitchDeg };
  stage.place(picture.width, picture.height, lensDeg, mask, box, ground);
  stage.setLight(result.light);
  stages.show(result.stages, result.light.radiance);
  light.show(result, { photo: name, model: config.model, longFovDeg });
  sendLight(result);
}

/** Photos that come with the page, and the box around the object of each. */
const EXAMPLES = { teapot: [152, 218, 322, 336], table: [130, 100, 325, 385] };

async function fetchPhoto(name) {
  return (await fetchExample(`photos/${name}.jpg`)).blob();
}

/** The example comes with its answer, so that the page is finished before any network is opened. */
async function openExample() {
  const mine = ++state.choice;
  const { picture, mask, longFovDeg, result } = await readExample();
  if (mine !== state.choice) return;
  const found = { data: mask, quality: null, notices: [] };
  put({ picture, longFovDeg, lensDeg: longFovDeg, name: "example", isExample: true, mask, box: objectBox(mask, picture.width), found, result });
  setStatus("This is an example. Choose a photo of an object of one material, or use the camera.");
}

/** The camera is closed; its last picture and light stay as a photo, else what was on show before it. */
async function closeCamera() {
  const still = await live.still();
  if (!live.running) return;
  if (still) {
    put(still);
    return setStatus("The camera is off; this is its last picture and light.");
  }
  live.stop();
  showAgain();
  if (!state.opened || state.opened.isExample) return openExample();
  if (state.opened.result) return setStatus("The camera is off; this is the photo before it.");
  return examine(ownMask);
}

/** Run what a user asked for; what fails becomes one line on the page. */
async function attempt(work) {
  try {
    await work();
  } catch (error) {
    setStatus(errorLine(error), "fault");
  }
}

listenForPhotos((blob, name) => attempt(() => open(blob, name)));
element("example").addEventListener("click", () => attempt(openExample));
for (const [name, box] of Object.entries(EXAMPLES)) {
  element(`example-${name}`).addEventListener("click", () => attempt(() => open(fetchPhoto(name), name, { box })));
}
element("outline").addEventListener("change", ({ target }) => element("mask").classList.toggle("plain", !target.checked));
element("reset").addEventListener("click", () => {
  if (live.running) return live.mark(marking.reset());
  if (!state.opened) return;
  Object.assign(state.opened, NOTHING); // what is found next is no correction of it
  marking.open(state.opened.picture);
  examine(ownMask);
});
/** From the last change of the pitch to the estimate with it. */
const PITCH_MS = 250;

/** Another light of the same object is wanted. */
function askAgain() {
  if (live.running) return attempt(() => live.setOptions());
  const { opened } = state;
  if (opened?.mask) examine(async () => opened.found, opened.hints);
}

surroundings.addEventListener("change", askAgain);
element("pitch").addEventListener("input", ({ target }) => stage.setPitch(Number(target.value)));
element("pitch").addEventListener("change", ({ target }) => {
  const view = live.running ? live : state.opened;
  if (!view) return;
  view.pitchDeg = Number(target.value);
  clearTimeout(state.pitchTimer);
  state.pitchTimer = setTimeout(askAgain, PITCH_MS); // a key that is held changes it again and again
});
element("camera").addEventListener("click", () => {
  if (live.running) return attempt(closeCamera);
  state.choice++;
  live.start();
});
tools.onFault = (error) => setStatus(errorLine(error), "fault");
await attempt(openExample);
if (!stage.stage.canDraw) {
  setStatus("This browser has no WebGL: lights are estimated, but no virtual object is drawn.", "fault");
}
document.documentElement.dataset.ready = "true";
