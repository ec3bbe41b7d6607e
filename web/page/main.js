/** The page: the photo on show and what the user does with it. */

import { LightPanel } from "./view/lightPanel.js";
import { Marking, NO_HINTS } from "./view/marking.js";
import { ObjectTools } from "./view/objectTools.js";
import { PhotoStage } from "./view/photoStage.js";
import { element, listenForPhotos, setStatus, sendLight, showFetched } from "./view/elements.js";
import { ProbeOpener } from "./probe.js";
import { LiveSession } from "./live/session.js";
import { lookAtGiven } from "../src/photo/maskCheck.js";
import { maskFromAlpha, objectBox } from "../src/photo/picture.js";
import { Machine } from "./machine.js";
import { openPhoto } from "./openPhoto.js";
import { PAGE, errorLine, sentence } from "./words.js";
import { fetchExample, readExample } from "./example.js";
import { showQuality, untold } from "./view/maskQuality.js";

const config = await (await fetch("config.json")).json();
if (config.server && !["localhost", "127.0.0.1", "[::1]"].includes(location.hostname)) {
  element("private").textContent = "Photos stay in this browser; HEIC and exports go to the machine that serves this page.";
}

/** An object before it is found: no mask, box, marks or light. */
const NOTHING = { mask: null, box: null, hints: NO_HINTS, found: null, result: null };

/** The photo on show, also behind the camera's picture: picture, name and lens, with NOTHING or more; null before the first. */
let shown = null;

/** Anything else can be put on show at any time: a photo, one with its answer, the camera's picture. */
const SHOWS = { opened: "finding", answered: "lit", filmed: "live" };
const MARKS = { marked: "finding", reset: "finding" };
const withMask = () => (shown?.mask ? "lighting" : null);
const withLight = () => (shown?.result ? "lit" : shown ? "bare" : "empty");
const asBefore = () => (shown.result ? "lit" : (withMask() ?? "bare"));

/** The page's states: no object is known, it is looked for, its light is estimated, both are on show; or the camera is followed. */
const NEXT = {
  empty: SHOWS,
  bare: { ...SHOWS, ...MARKS, asked: withMask },
  finding: { ...SHOWS, ...MARKS, found: "lighting", missed: asBefore, failed: withLight },
  lighting: { ...SHOWS, ...MARKS, asked: "lighting", estimated: "lit", failed: withLight },
  lit: { ...SHOWS, ...MARKS, asked: "lighting" },
  live: { ...SHOWS, marked: "live", reset: "live", asked: "live", closed: () => (shown.result ? "lit" : "finding"), failed: withLight },
};

const ENTER = {
  /** Again, after a camera that failed before anything else was on show. */
  empty: ({ error }) => say(errorLine(error), "fault"),

  /** By what was marked, else as the photo itself or the network proposes. */
  async finding({ hints = null, ...opened }, event, left) {
    if (event === "opened") put(opened);
    if (event === "closed") showAgain();
    if (event === "reset") {
      Object.assign(shown, NOTHING); // what is found next is no correction of it
      marking.open(shown.picture);
    }
    say(DOING.finding);
    const found = hints ? await askForMask(hints, left) : await ownMask(left);
    const box = found && objectBox(found.data, shown.picture.width);
    machine.send(box ? "found" : "missed", { found, box, hints: hints ?? NO_HINTS }, left);
  },

  /** Of what was found, or of the last object: another light of it, or its first where a mark that came meanwhile found nothing. */
  async lighting({ found, box, hints }, event, left) {
    const { seconds, ...kept } = event === "found" ? found : shown.found;
    if (event === "found") Object.assign(shown, { mask: found.data, box, hints, found: kept });
    shown.result = null;
    showOutline();
    showQuality(shown.found);
    const probe = await networks.open();
    if (left.aborted) return;
    say(DOING.lighting);
    const { picture, mask, longFovDeg, lensDeg } = shown;
    const result = await probe.examine({ picture, mask, longFovDeg, isLensKnown: lensDeg !== null, options: options() });
    machine.send("estimated", { result, seconds, word: event === "missed" ? staying(found) : undefined }, left);
  },

  lit({ result, seconds, word, error, found, ...answered }, event) {
    if (event === "answered") put({ ...answered, found, result });
    if (event === "estimated") {
      shown.result = result;
      showLight();
      return word ? say(...word) : sayLit(seconds);
    }
    if (event === "closed" || !stage.video.hidden) showAgain();
    else if (event !== "answered") showOutline();
    if (event === "missed") say(...staying(found));
    if (event === "closed") say("The camera is off; this is the photo before it.");
    if (error) say(errorLine(error), "fault");
  },

  /** The picture alone, and its object's outline where its light failed. */
  bare({ found, error }, event) {
    if (event === "missed") Object.assign(shown, NOTHING);
    if (!stage.video.hidden) showAgain();
    stage.showPicture(shown.picture);
    showOutline();
    showQuality(shown.found);
    light.clear();
    if (error) return say(errorLine(error), "fault");
    const [why] = found?.notices ?? [];
    const advice = "Click on the object, or draw a box around it.";
    say(why ? `${sentence(why)} ${advice}` : advice, why ? "warning" : "");
  },

  async live({ hints }, event) {
    if (event === "filmed") {
      showQuality(null);
      return light.clear();
    }
    try {
      await (event === "asked" ? live.setOptions() : live.mark(event === "reset" ? marking.reset() : hints));
    } catch (error) {
      say(errorLine(error), "fault"); // the camera is followed on
    }
  },
};

/** Lines of status to go back to after a file that was still needed has come. */
const DOING = { finding: "Finding the object …", lighting: "Estimating the lighting …" };

const machine = new Machine("empty", NEXT, ENTER);
const isLive = () => machine.state === "live";
const stage = new PhotoStage();
const networks = new ProbeOpener(config, showDownload, stage.stage.isSoftware ? 1 : 0); // software then draws
const tools = new ObjectTools(stage);
const light = new LightPanel(config);
const marking = new Marking(
  { canvas: element("mask"), cursor: element("cross"), removing: element("removing"), band: element("band"), button: element("draw-box") },
  stage,
  (hints) => machine.send("marked", { hints }),
);
const surroundings = element("surroundings");
const options = () => ({ surroundings: surroundings.value, pitchDeg: (isLive() ? live : shown).pitchDeg });
const live = new LiveSession({
  networks, config, stage, light, marking, options,
  onShown: () => machine.send("filmed"),
  onMask: showQuality,
  onFault: (error) => (isLive() ? machine.send("failed", { error }) : setStatus(errorLine(error), "fault")),
});

/** The file being fetched. @type {string | null} */
let fetched = null;

/** One line a file with a bar, and one where it stalls; lines of the camera stay once it is followed. */
function showDownload({ file, loaded, total, stalled }) {
  const size = total ? ` of ${(total / 1e6).toFixed(1)}` : "";
  if (stalled) setStatus(`Waiting for ${file}: ${(loaded / 1e6).toFixed(1)}${size} MB have come. Check the connection.`);
  else if (!live.following) {
    if (file !== fetched) setStatus(`Fetching ${file}${total ? `, ${(total / 1e6).toFixed(1)} MB` : ""} …`);
    showFetched(loaded, total);
    if (machine.state in DOING && loaded === total) setStatus(DOING[machine.state]);
  }
  fetched = stalled ? null : file;
}

/** Of the photo on show; less than what is said of a camera that is being opened. */
function say(...line) {
  if (!live.opening) setStatus(...line);
}

/** Show a picture in place of another or of the camera's. */
function put(found) {
  live.stop();
  shown = { ...NOTHING, ...found };
  showAgain();
}

function showAgain() {
  const { picture, mask, found, result } = shown;
  stage.showPicture(picture);
  marking.open(picture);
  if (mask) showOutline();
  showQuality(found);
  if (result) return showLight();
  light.clear();
}

/** What was found of the object on show, and by which marks. */
function showOutline() {
  const { picture, mask, hints } = shown;
  marking.show(mask && { ...picture, data: mask }, hints);
}

/** The picture's own transparency or the mask network's proposal; null without both: then a click is needed. */
async function ownMask(left) {
  const { picture } = shown;
  const own = maskFromAlpha(picture);
  if (!own) return (await networks.open()).hasMask ? askForMask(marking.hints, left) : null;
  const { mask, warnings } = lookAtGiven(own, picture.width);
  return { data: mask, quality: null, notices: warnings };
}

async function askForMask(hints, left) {
  const probe = await networks.open();
  return probe.mask(shown.picture, { ...hints, signal: left });
}

function showLight() {
  const { picture, longFovDeg, lensDeg, name, mask, box, result, pitchDeg } = shown;
  const ground = pitchDeg === undefined ? result.light.ground : { pitchDeg };
  stage.place(picture.width, picture.height, lensDeg ?? result.light.ground?.longFovDeg ?? null, mask, box, ground);
  stage.setLight(result.light);
  light.show(result, { photo: name, model: config.model, longFovDeg });
  sendLight(result);
}

function sayLit(seconds) {
  const { found, result } = shown;
  const doubt = untold(found, result.light);
  if (doubt) return say(`Estimated, but ${PAGE.line(doubt)}.`, "warning");
  const search = seconds === undefined ? "" : `object found in ${seconds.toFixed(1)} s, `;
  say(`Estimated: ${search}light in ${result.seconds.toFixed(1)} s. If the outline is wrong, click on the object, or draw a box around it.`);
}

/** Drop a mark that found nothing; the last object and its light stay. */
function staying(found) {
  return [`${sentence(found?.notices[0])} The last object and its light stay: click on the object, or draw a box around it.`, "warning"];
}

/** A picture that is ready after another was chosen is dropped. */
let choice = 0;

async function choose(event, read) {
  const mine = ++choice;
  try {
    const found = await read();
    if (mine === choice) machine.send(event, found);
  } catch (error) {
    setStatus(errorLine(error), "fault");
  }
}

/** Show a photo once it is decoded. @param {Blob | Promise<Blob>} blob @param {object} [hints] in its pixels */
function open(blob, name, hints) {
  return choose("opened", async () => {
    setStatus("Opening the photo …");
    return { ...(await openPhoto(await blob, name, config.server)), hints: hints && { ...NO_HINTS, ...hints } };
  });
}

/** Around the object of the photo that comes with the page. */
const TEAPOT = [152, 218, 322, 336];

/** The example comes with its answer, so that the page is finished before any network is opened. */
async function openExample() {
  await choose("answered", async () => {
    const { mask, ...example } = await readExample();
    const box = objectBox(mask, example.picture.width);
    return { ...example, lensDeg: example.longFovDeg, name: "example", isExample: true, mask, box, found: { data: mask, quality: null, notices: [] } };
  });
  if (shown?.isExample) setStatus("This is an example. Choose a photo of an object of one material, or use the camera.");
}

/** Close the camera; its last picture and light stay as a photo, else what was on show before. */
async function closeCamera() {
  const still = await live.still();
  if (!isLive()) return;
  if (still) {
    machine.send("answered", still);
    return setStatus("The camera is off; this is its last picture and light.");
  }
  live.stop();
  if (!shown || shown.isExample) return openExample();
  machine.send("closed");
}

listenForPhotos(open);
element("example").addEventListener("click", openExample);
element("example-teapot").addEventListener("click", () => {
  const photo = fetchExample("photos/teapot.jpg").then((answer) => answer.blob());
  open(photo, "teapot", { box: TEAPOT });
});
element("outline").addEventListener("change", ({ target }) => element("mask").classList.toggle("plain", !target.checked));
element("reset").addEventListener("click", () => machine.send("reset"));
surroundings.addEventListener("change", () => machine.send("asked"));

/** Delay from the last change of the pitch to the estimate: a held key changes it repeatedly. */
const PITCH_MS = 250;
let pitchTimer;

element("pitch").addEventListener("input", ({ target }) => stage.setPitch(Number(target.value)));
element("pitch").addEventListener("change", ({ target }) => {
  const view = isLive() ? live : shown;
  if (!view) return;
  view.pitchDeg = Number(target.value);
  clearTimeout(pitchTimer);
  pitchTimer = setTimeout(() => machine.send("asked"), PITCH_MS);
});
element("camera").addEventListener("click", () => {
  if (isLive()) return closeCamera();
  choice++;
  live.start();
});
tools.onFault = (error) => setStatus(errorLine(error), "fault");
await openExample();
if (!stage.stage.canDraw) {
  setStatus("This browser has no WebGL: lights are estimated, but no virtual object is drawn.", "fault");
}
document.documentElement.dataset.ready = "true";
