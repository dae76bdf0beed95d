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

const FRAMES = 13;
const SLOWEST_MS = 1000 / 24; // slower is no screen
let screen = 0;
let measuring = false;

/** From one picture of the screen to the next; 0: not known yet. */
export const screenMs = (): number => screen;

/** While nothing is drawn, which `idle` tells. A window may have been moved to another screen: so again and again. */
export function measureScreen(idle = (): boolean => true): void {
  if (measuring) return;
  measuring = true;
  const times: number[] = [];
  const next = (now: number): void => {
    times.push(now);
    measuring = idle() && times.length < FRAMES;
    if (measuring) requestAnimationFrame(next);
    else if (idle()) screen = Math.min(usualWait(times), SLOWEST_MS);
  };
  requestAnimationFrame(next);
}

// Of one that was late and of the next, which is early, neither counts.
function usualWait(times: number[]): number {
  const waits = times.slice(1).map((time, i) => time - times[i]!).sort((a, b) => a - b);
  return waits[waits.length >> 1]!;
}
