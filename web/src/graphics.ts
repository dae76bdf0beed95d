// What draws 3-D pictures in this browser.
let software: boolean | undefined;

/** Whether it is the processor: smooth edges would take four times as long. */
export function drawnBySoftware(): boolean {
  return (software ??= SOFTWARE.test(rendererName()));
}

const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

function rendererName(): string {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return name;
}
