/** The page: its elements, and what happens between them. */

import { LightPanel } from "./view/lightPanel.js";
import { MaskEditor } from "./view/maskEditor.js";
import { ObjectTools } from "./view/objectTools.js";
import { PhotoStage } from "./view/photoStage.js";
import { StagesPanel } from "./view/stagesPanel.js";
import { element, listenForPhotos, setStatus } from "./view/elements.js";
import { Networks } from "./networks/client.js";
import { LiveSession } from "./live/session.js";
import { maskFromAlpha, objectBox } from "./photo/picture.js";
import { openPhoto } from "./photo/open.js";
import { readExample } from "./photo/example.js";

const config = await (await fetch("config.json")).json();
if (config.server && !["localhost", "127.0.0.1", "[::1]"].includes(location.hostname)) {
  element("private").textContent = "Photos stay in this browser; HEIC and exports go to the machine that serves this page.";
}
const stage = new PhotoStage();
const networks = new Networks(
  ({ done, of }) => {
    if (done < of) setStatus(`Opening the networks, ${done + 1} of ${of} …`);
  },
  stage.stage.isSoftware ? 1 : 0, // which then draws
);
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
const spread = element("spread");
for (const row of ["surroundings-row", "spread-row"]) element(row).hidden = !config.weights.light; // not for the paper's chain
const asked = () => ({ surroundings: surroundings.checked, spread: spread.checked });

const live = new LiveSession({ networks, config, stage, light, stages, editor, asked });

let opened = null;
let marked = null; // the mask that the light on show was told from
let turn = 0; // of what was asked for last: older answers are dropped

/** Show a photo; find its object; estimate. */
async function open(blob, name) {
  live.stop();
  const mine = ++turn;
  setStatus("Opening the photo …");
  const found = await openPhoto(blob, name, config.server);
  if (mine !== turn) return;
  opened = found;
  stage.showPicture(opened.picture);
  stages.clear();
  editor.open(opened.picture);
  const mask = maskFromAlpha(opened.picture) ?? (await proposal());
  if (mine === turn) await estimate(mask);
}

/** The mask network's own proposal, or null: then a click is needed. */
async function proposal() {
  const { hasMask } = await networks.open(config);
  return hasMask ? networks.ask("mask", { picture: opened.picture, hints: editor.hints }) : null;
}

async function remask(hints) {
  await attempt(async () => {
    await networks.open(config);
    setStatus("Finding the object …");
    await estimate(await networks.ask("mask", { picture: opened.picture, hints }));
  });
}

async function estimate(mask) {
  const mine = turn;
  const { picture, longFovDeg } = opened;
  editor.show(mask);
  const box = mask && objectBox(mask, picture.width);
  if (!box) return setStatus("Click on the object in the picture “Object” below, or draw a box around it.");
  await networks.open(config);
  setStatus("Estimating the light …");
  const isWhole = maskFromAlpha(picture) === null; // else no canvas tells what is hidden
  const wanted = { ...asked(), surroundings: surroundings.checked && isWhole };
  const result = await networks.ask("estimate", { picture, mask, longFovDeg, asked: wanted });
  if (mine !== turn) return;
  show(result, mask, box);
  if (surroundings.checked && !result.known.surroundings) {
    return setStatus("Around the object this photo shows no place but one colour or nothing: the object alone told this light.");
  }
  setStatus(`Estimated in ${result.seconds.toFixed(2)} s, in this browser. If the outline is wrong, click on the object below, or draw a box around it.`);
}

function show(result, mask, box) {
  marked = mask;
  stage.place(opened.picture.width, opened.picture.height, opened.longFovDeg, mask, box);
  stage.setLight(result.light);
  stages.show(result.stages, result.light.radiance);
  light.show(result, { photo: opened.name, model: config.model, longFovDeg: opened.longFovDeg });
}

/** The example comes with its answer, so that the page is finished before any network is opened. */
async function openExample() {
  live.stop();
  const mine = ++turn;
  const { picture, mask, longFovDeg, result } = await readExample();
  if (mine !== turn) return;
  opened = { picture, longFovDeg, name: "example" };
  stage.showPicture(opened.picture);
  editor.open(opened.picture);
  editor.show(mask);
  show(result, mask, objectBox(mask, opened.picture.width));
  if (surroundings.checked || spread.checked) return estimate(mask);
  setStatus("This is an example. Choose a photo of an object of one material, or use the camera.");
}

/** Run what a user asked for; what fails becomes one line on the page. */
async function attempt(work) {
  try {
    await work();
  } catch (error) {
    setStatus(error.message, true);
  }
}

listenForPhotos((blob, name) => attempt(() => open(blob, name)));
element("example").addEventListener("click", () => attempt(openExample));
element("reset").addEventListener("click", () => {
  if (live.running) return live.mark(editor.reset());
  editor.open(opened.picture);
  attempt(async () => estimate(maskFromAlpha(opened.picture) ?? (await proposal())));
});
for (const box of [surroundings, spread]) {
  box.addEventListener("change", () => attempt(() => (live.running ? live.ask() : estimate(marked))));
}
element("camera").addEventListener("click", () => attempt(() => (live.running ? openExample() : (++turn, live.start()))));
tools.onFault = (error) => setStatus(error.message, true);
await attempt(openExample);
document.documentElement.dataset.ready = "true";
