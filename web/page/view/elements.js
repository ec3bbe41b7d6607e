/** The page's elements by id, its line of status, and the ways a photo can come. */

export const element = (id) => document.getElementById(id);

/** In the lines that advise it, a link to the photo, on which the object is marked. */
const MARKING = /click on (?:the object|it|another)(?: in the photo)?(?:, or draw a box around it)?/i;

/** One line for everyone, read aloud by screen readers; kind: "fault" or "warning", shown in colour. */
export function setStatus(text, kind = "") {
  const status = element("status");
  const [advice] = text.match(MARKING) ?? [];
  const [before, after] = advice ? text.split(advice) : [text, ""];
  const link = Object.assign(document.createElement("a"), { href: "#mask", textContent: advice });
  status.replaceChildren(before, ...(advice ? [link, after] : []));
  for (const one of ["fault", "warning"]) status.classList.toggle(one, one === kind);
  element("fetched").hidden = true;
}

/** How much of a file has come, below the line of status until the next one; total: null where it is not known. */
export function showFetched(loaded, total) {
  const bar = element("fetched");
  bar.hidden = false;
  if (total) Object.assign(bar, { max: total, value: loaded });
  else bar.removeAttribute("value");
}

/** Every light on show, of a photo or of a camera's picture, as the document's event "anyprobe-light". */
export function sendLight(detail) {
  document.dispatchEvent(new CustomEvent("anyprobe-light", { detail }));
}

/** Call open(blob, name) for every photo that is chosen, dropped or pasted. */
export function listenForPhotos(open) {
  const file = element("file");
  element("choose").addEventListener("click", () => file.click());
  file.addEventListener("change", () => {
    if (file.files.length) open(file.files[0], file.files[0].name);
    file.value = ""; // the same photo may be chosen again
  });
  document.addEventListener("paste", (event) => {
    const pasted = [...(event.clipboardData?.files ?? [])][0];
    if (pasted) open(pasted, pasted.name || "pasted");
  });
  const drop = element("drop");
  let depth = 0;
  const hide = () => (drop.hidden = (depth = 0) === 0);
  document.addEventListener("dragenter", () => (drop.hidden = ++depth === 0));
  document.addEventListener("dragleave", () => (--depth <= 0 ? hide() : null));
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    hide();
    const dropped = [...event.dataTransfer.files][0];
    if (dropped) open(dropped, dropped.name);
  });
}
