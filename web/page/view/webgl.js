/** Whether there is WebGL, and whether the processor draws it: then what is drawn takes from the networks. */
export function findWebgl() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return { canDraw: false, isSoftware: false };
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return { canDraw: true, isSoftware: /swiftshader|llvmpipe|software|basic render/i.test(name) };
}
