/** The page's elements by id, its status line, and all ways to give a photo. */

export const element = (id) => document.getElementById(id);

/** Put a link to the photo into messages that advise to mark the object. */
const MARKING = /click on (?:the object|it|another)(?: in the photo)?(?:, or draw a box around it)?/i;

/** Show one status line, which screen readers read aloud; kind: "fault" or "warning", shown in colour. */
export function setStatus(text, kind = "") {
  const status = element("status");
  const [advice] = text.match(MARKING) ?? [];
  const [before, after] = advice ? text.split(advice) : [text, ""];
  const link = Object.assign(document.createElement("a"), { href: "#mask", textContent: advice });
  status.replaceChildren(before, ...(advice ? [link, after] : []));
  for (const one of ["fault", "warning"]) status.classList.toggle(one, one === kind);
  element("fetched").hidden = true;
}

/** Show a download's progress below the status line; total: null if unknown. */
export function showFetched(loaded, total) {
  const bar = element("fetched");
  bar.hidden = false;
  if (total) Object.assign(bar, { max: total, value: loaded });
  else bar.removeAttribute("value");
}

/** Dispatch every light on show as the document's event "anyprobe-light". */
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
