/** The page: its elements, and what happens between them. */

import { LightPanel } from "./view/lightPanel.js";
import { MaskEditor, NO_HINTS } from "./view/maskEditor.js";
import { ObjectTools } from "./view/objectTools.js";
import { PhotoStage } from "./view/photoStage.js";
import { StagesPanel } from "./view/stagesPanel.js";
import { element, listenForPhotos, setStatus, sendLight, showFetched } from "./view/elements.js";
import { ProbeOpener } from "./probe.js";
import { LiveSession } from "./live/session.js";
import { maskFromAlpha, objectBox } from "../src/photo/picture.js";
import { openPhoto } from "./openPhoto.js";
import { inPage, sentence } from "./words.js";
import { readExample } from "./example.js";
import { showQuality } from "./view/maskQuality.js";
import { askReflections } from "./reflections.js";

const config = await (await fetch("config.json")).json();
if (config.server && !["localhost", "127.0.0.1", "[::1]"].includes(location.hostname)) {
  element("private").textContent = "Photos stay in this browser; HEIC and exports go to the machine that serves this page.";
}
const stage = new PhotoStage();
const networks = new ProbeOpener(config, showDownload, stage.stage.isSoftware ? 1 : 0); // software then draws
let fetched = null; // the file that is on its way
let doing = null; // said again once a file that it takes has come
let searching = null; // ends the search of a mask that is no longer wanted
const tools = new ObjectTools(stage);
const light = new LightPanel(config);
const stages = new StagesPanel();
const editor = new MaskEditor(
  {
    canvas: element("mask"),
    cursor: element("cross"),
    removing: element("removing"),
    band: element("band"),
    button: element("draw-box"),
  },
  (hints) => (live.running ? live.mark(hints) : remask(hints)),
);
const surroundings = element("surroundings");
const soften = element("soften");
const reflections = element("reflections");
element("reflections-row").hidden = !config.server; // the library of places is the server's
for (const row of ["surroundings-row", "soften-row"]) element(row).hidden = !config.weights.light; // not for the paper's chain
const options = () => ({
  surroundings: surroundings.value,
  emitters: soften.checked ? "expected" : "mode",
  pitchDeg: (live.running ? live : opened).pitchDeg,
});

/** One line a file with a bar, and one where it stalls; lines of the camera stay once it is followed. */
function showDownload({ file, loaded, total, stalled }) {
  const size = total ? ` of ${(total / 1e6).toFixed(1)}` : "";
  if (stalled) setStatus(`Waiting for ${file}: ${(loaded / 1e6).toFixed(1)}${size} MB have come. Check the connection.`);
  else if (!live.following) {
    if (file !== fetched) setStatus(`Fetching ${file}${total ? `, ${(total / 1e6).toFixed(1)} MB` : ""} …`);
    showFetched(loaded, total);
    if (doing && loaded === total) setStatus(doing);
  }
  fetched = stalled ? null : file;
}

/** The picture, its field of view and name; of its object and light what there is; the given pitch. */
let opened = null;
/** Of an object that is not found: no mask with its box and what it was found by, no light. */
const NOTHING = { mask: null, box: null, hints: NO_HINTS, found: null, result: null };
let choice = 0; // of a picture or the camera: one that is ready after another was chosen is dropped
let turn = 0; // of questions about the picture on show: older answers are dropped

const live = new LiveSession({
  networks,
  config,
  stage,
  light,
  stages,
  editor,
  options,
  onShown: () => {
    turn++;
    searching?.abort();
    showQuality(null);
    light.clear();
    stages.clear();
    reflections.disabled = true; // for photos
  },
  onMask: showQuality,
  onFault: (error) => {
    showAgain();
    setStatus(error.message, "fault");
  },
});

/** Of the photo on show; less than what is said of a camera that is being opened. */
function tell(...given) {
  if (!live.opening) setStatus(...given);
}

/** Show a photo; find its object; estimate. What was on show stays until the photo is decoded. */
async function open(blob, name) {
  const mine = ++choice;
  setStatus("Opening the photo …");
  const found = await openPhoto(blob, name, config.server);
  if (mine !== choice) return;
  put(found);
  await examine(ownMask);
}

/** A picture in the place of another or of the camera's. */
function put(found) {
  live.stop();
  searching?.abort();
  turn++;
  opened = { ...NOTHING, ...found };
  showOpened();
}

function showOpened() {
  const { picture, mask, hints, result } = opened;
  reflections.disabled = false;
  stage.showPicture(picture);
  editor.open(picture);
  if (mask) editor.show(mask, hints);
  showQuality(opened.found);
  if (result) return showLight();
  light.clear();
  stages.clear();
}

/** The opened picture where the camera's has ended. */
function showAgain() {
  if (opened && !stage.video.hidden) showOpened();
}

/** The picture's own transparency or the mask network's proposal; null without both: then a click is needed. */
async function ownMask(picture, isLate) {
  const mask = maskFromAlpha(picture);
  if (mask) return { mask, quality: null, notices: [] };
  const probe = await networks.open();
  return probe.hasMask ? findMask(picture, editor.hints, isLate) : null;
}

function remask(hints) {
  return examine((picture, isLate) => findMask(picture, hints, isLate), hints);
}

async function findMask(picture, { on, off, box }, isLate) {
  const probe = await networks.open();
  if (isLate()) return null;
  searching?.abort();
  searching = new AbortController();
  doing = "Finding the object …";
  tell(doing);
  try {
    return await probe.mask(picture, { click: on, exclude: off, box, signal: searching.signal });
  } finally {
    if (!isLate()) doing = null;
  }
}

/**
 * Find the object of the picture on show, by what was marked, and its light. What comes or fails after something newer was
 * asked is dropped.
 */
async function examine(maskOf, hints = NO_HINTS) {
  const mine = ++turn;
  const isLate = () => mine !== turn;
  try {
    const found = await maskOf(opened.picture, isLate);
    if (!isLate()) await estimate(found, hints, isLate);
  } catch (error) {
    if (isLate()) return;
    editor.show(opened.mask, opened.hints);
    if (!opened.result) hideLight();
    tell(error.message, "fault");
  }
}

async function estimate(found, hints, isLate) {
  const { picture, longFovDeg } = opened;
  const mask = found?.mask ?? null;
  const box = mask && objectBox(mask, picture.width);
  if (!box && opened.mask) return stay(found?.notices[0], isLate);
  editor.show(mask, box ? hints : NO_HINTS);
  showQuality(box ? found : null);
  if (!box) return showNothing(found?.notices[0]);
  const { seconds, ...kept } = found;
  Object.assign(opened, { mask, box, hints, found: kept, result: null });
  const probe = await networks.open();
  if (isLate()) return;
  tell("Estimating the lighting …");
  const result = await probe.examine({ picture, mask, longFovDeg, options: options() });
  if (isLate()) return;
  opened.result = result;
  showLight();
  const [doubt] = [...found.notices, ...result.light.notices];
  if (doubt) return tell(`Estimated, but ${inPage(doubt)}.`, "warning");
  const search = seconds === undefined ? "" : `object found in ${seconds.toFixed(1)} s, `;
  tell(`Estimated: ${search}light in ${result.seconds.toFixed(1)} s. If the outline is wrong, click on the object below, or draw a box around it.`);
}

/** What was marked found nothing: the last object and its light stay, the mark does not. */
async function stay(why, isLate) {
  const { mask, hints, found, result } = opened;
  if (result) editor.show(mask, hints);
  else await estimate(found, hints, isLate); // its light was on its way
  if (!isLate()) tell(`${sentence(why)} The last object and its light stay: click on the object below, or draw a box around it.`, "warning");
}

/** Nothing of the last light is left. @param {string} [why] where it was looked for */
function showNothing(why) {
  Object.assign(opened, NOTHING);
  hideLight();
  const advice = "Click on the object in the picture “Object” below, or draw a box around it.";
  setStatus(why ? `${sentence(why)} ${advice}` : advice, why ? "warning" : "");
}

/** The picture alone. */
function hideLight() {
  stage.showPicture(opened.picture);
  light.clear();
  stages.clear();
}

function showLight() {
  const { picture, longFovDeg, lensDeg, name, mask, box, result, pitchDeg } = opened;
  const ground = pitchDeg === undefined ? result.light.ground : { pitchDeg };
  stage.place(picture.width, picture.height, lensDeg, mask, box, ground);
  stage.setLight(result.light);
  stages.show(result.stages, result.light.radiance);
  light.show(result, { photo: name, model: config.model, longFovDeg });
  sendLight(result);
  if (reflections.checked) attempt(reflect);
}

/** Sharp reflections for the light on show, or its own again. */
async function reflect() {
  const { result } = opened;
  if (reflections.checked) result.reflections ??= await askReflections(result.light);
  if (live.running || opened.result !== result) return;
  const shown = reflections.checked ? result.reflections : null;
  stage.setLight(result.light, shown);
  light.showReflections(shown);
}

/** The example comes with its answer, so that the page is finished before any network is opened. */
async function openExample() {
  const mine = ++choice;
  const { picture, mask, longFovDeg, result } = await readExample();
  if (mine !== choice) return;
  const found = { mask, quality: null, notices: [] };
  put({ picture, longFovDeg, lensDeg: longFovDeg, name: "example", isExample: true, mask, box: objectBox(mask, picture.width), found, result });
  if (soften.checked) return examine(async () => found);
  setStatus("This is an example. Choose a photo of an object of one material, or use the camera.");
}

/** The camera is closed at once; the photo before it takes its place, or the example. */
function closeCamera() {
  live.stop();
  showAgain();
  if (!opened || opened.isExample) return openExample();
  if (opened.result) return setStatus("The camera is off; this is the photo before it.");
  return examine(ownMask);
}

/** Run what a user asked for; what fails becomes one line on the page. */
async function attempt(work) {
  try {
    await work();
  } catch (error) {
    setStatus(error.message, "fault");
  }
}

listenForPhotos((blob, name) => attempt(() => open(blob, name)));
element("example").addEventListener("click", () => attempt(openExample));
element("reset").addEventListener("click", () => {
  if (live.running) return live.mark(editor.reset());
  if (!opened) return;
  Object.assign(opened, NOTHING); // what is found next is no correction of it
  editor.open(opened.picture);
  examine(ownMask);
});
/** From the last change of the pitch to the estimate with it. */
const PITCH_MS = 250;
let pitchTimer;

/** Another light of the same object is wanted. */
function askAgain() {
  if (live.running) return attempt(() => live.setOptions());
  if (opened?.mask) examine(async () => opened.found, opened.hints);
}

for (const choice of [surroundings, soften]) choice.addEventListener("change", askAgain);
element("pitch").addEventListener("input", ({ target }) => stage.setPitch(Number(target.value)));
element("pitch").addEventListener("change", ({ target }) => {
  const view = live.running ? live : opened;
  if (!view) return;
  view.pitchDeg = Number(target.value);
  clearTimeout(pitchTimer);
  pitchTimer = setTimeout(askAgain, PITCH_MS); // a key that is held changes it again and again
});
reflections.addEventListener("change", () => {
  if (opened?.result && !live.running) attempt(reflect);
});
element("camera").addEventListener("click", () => {
  if (live.running) return attempt(closeCamera);
  choice++;
  live.start();
});
tools.onFault = (error) => setStatus(error.message, "fault");
await attempt(openExample);
if (!stage.stage.canDraw) {
  setStatus("This browser has no WebGL: lights are estimated, but no virtual object is drawn.", "fault");
}
document.documentElement.dataset.ready = "true";
