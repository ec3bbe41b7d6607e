// What a canvas makes of picture files. arguments: { files: { name: base64 } } -> { name: base64 of RGBA }

export default async ({ page, url, arguments: { files } }) => {
  await page.goto(`${url}blank.html`);
  return page.evaluate(async (given) => {
    const found = {};
    for (const [name, text] of Object.entries(given)) {
      const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
      const bitmap = await createImageBitmap(new Blob([bytes]));
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
      context.drawImage(bitmap, 0, 0);
      const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
      found[name] = btoa(Array.from(data, (value) => String.fromCharCode(value)).join(""));
    }
    return found;
  }, files);
};
