// A joint through a scope: the canvas with what draws on it, and the round picture that shows it, with words over it or
// instead of it. Whoever draws decides what and when.
import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";
import type { LiveSession } from "wire";
import { Broken, Loading } from "./kit";
import { loadKnee, type Knee } from "./scene/anatomy";
import { Arthroscope } from "./scene/arthroscope";
import { Joint } from "./scene/joint";
import { notchAngle, USUAL_OPTIC, type Optic } from "./scene/optic";
import { NoWebGl } from "./scene/view3d";
import { text } from "./text";

/** As the station has it; a server that says nothing of it has 0 for its angle. */
export const opticOf = (session: LiveSession | undefined): Optic =>
  session?.opticViewDeg ? { tiltDeg: session.opticDeg, fieldDeg: session.opticViewDeg, postDeg: 0 } : USUAL_OPTIC;

function newCanvas(): HTMLCanvasElement {
  const canvas = Object.assign(document.createElement("canvas"), { className: "scope-canvas", role: "img" });
  canvas.setAttribute("aria-label", text.scope.picture);
  return canvas;
}

export class ScopeStage {
  readonly said = signal<ComponentChildren>(undefined); // instead of the picture
  shown: { joint: Joint; optic: Arthroscope } | undefined;
  canvas = newCanvas();
  private told = "";
  private side = 0; // px of the page
  private knee = ""; // which one is shown, or asked for
  private round: HTMLElement | undefined; // its parent says how large it may be

  /** `changed`: the next picture is another one, though nothing moved. */
  constructor(private optic: Optic, private readonly changed: () => void) {}

  /** Into the round picture of a frame. Returns what ends it. */
  attach(lens: HTMLElement): () => void {
    const round = (this.round = lens.parentElement!);
    lens.append(this.canvas);
    const size = new ResizeObserver(() => this.measure());
    size.observe(round.parentElement!);
    this.measure();
    this.setOptic(this.optic);
    return () => {
      size.disconnect();
      this.drop();
      this.round = undefined;
    };
  }

  setOptic(optic: Optic): void {
    this.optic = optic;
    this.shown?.optic.setOptic(optic);
    this.round?.style.setProperty("--notch", `${notchAngle(optic)}rad`);
  }

  /** `name` tells words apart: the same ones are not drawn again. */
  say(name: string, words: () => ComponentChildren): void {
    if (name === this.told) return;
    this.told = name;
    this.said.value = words();
  }

  showPicture(): void {
    this.say("", () => undefined);
  }

  /** Loads the session's knee, if it is another one. */
  load({ caseName, caseHash, groups }: LiveSession): void {
    const key = `${caseName} ${caseHash}`;
    if (key === this.knee) return;
    this.knee = key;
    this.say(`loading ${key}`, () => <Loading what={text.session.loadingCase(caseName)} />);
    const again = (): void => {
      this.knee = "";
      this.load({ caseName, caseHash, groups } as LiveSession);
    };
    loadKnee(caseName, key, groups).then(
      (knee) => this.knee === key && this.round && this.begin(knee),
      () => this.knee === key && this.say(`broken ${key}`, () => <Broken title={text.session.noCase} hint="" again={again} />));
  }

  private begin(knee: Knee): void {
    this.drop();
    this.canvas.replaceWith((this.canvas = newCanvas())); // one that no renderer has had
    const joint = new Joint(knee, true);
    try {
      this.shown = { joint, optic: new Arthroscope(this.canvas, joint, this.optic) };
    } catch (error) {
      if (!(error instanceof NoWebGl)) throw error;
      this.say("no scene", () => <Broken title={text.session.noScene} hint={text.session.noSceneHint} />);
      return;
    }
    this.shown.optic.setSide(this.side);
    this.changed();
  }

  private drop(): void {
    this.shown?.optic.close();
    this.shown?.joint.dispose();
    this.shown = undefined;
  }

  private measure(): void {
    const { clientWidth, clientHeight } = this.round!.parentElement!;
    const side = Math.floor(Math.min(clientWidth, clientHeight));
    if (side === this.side || side <= 0) return;
    this.side = side;
    this.round!.style.width = this.round!.style.height = `${side}px`;
    this.shown?.optic.setSide(side);
    this.changed();
  }
}

/** The round picture, as large as the element that it is in, or the words instead of it. */
export function ScopeFrame({ stage }: { stage: ScopeStage }) {
  const lens = useRef<HTMLDivElement>(null);
  const said = stage.said.value;
  useLayoutEffect(() => stage.attach(lens.current!), [stage]); // closed before the next view begins
  return <>
    <div class={said ? "scope-round dark" : "scope-round"}><div class="scope-lens" ref={lens} /><i class="scope-edge" aria-hidden="true" /><i class="scope-notch" aria-hidden="true" /></div>
    <div class="scope-state">{said}</div>
  </>;
}
