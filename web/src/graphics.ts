// What draws 3-D pictures in this browser, and how often its screen shows one.
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

const FRAMES = 12;
let screen: Promise<number> | undefined;

/** From one picture of the screen to the next. First asked for before anything is drawn, so that nothing but the screen is slow. */
export function screenMs(): Promise<number> {
  return (screen ??= new Promise((resolve) => {
    const times: number[] = [];
    const next = (now: number): void => {
      times.push(now);
      if (times.length <= FRAMES) requestAnimationFrame(next);
      else resolve(shortest(times));
    };
    requestAnimationFrame(next);
  }));
}

const shortest = (times: number[]): number => Math.min(...times.slice(1).map((time, i) => time - times[i]!));
