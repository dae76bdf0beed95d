// The planned resection on the knee of a session, from above: what is to go, before it is cut.
import { useEffect, useRef, useState } from "preact/hooks";
import { Vector3 } from "three";
import type { LiveSession } from "wire";
import { newRow } from "../history";
import { loadKnee, type Knee } from "../scene/anatomy";
import { Joint, USUAL_SHOW, type Show } from "../scene/joint";
import { NoWebGl, View3D } from "../scene/view3d";
import { text } from "../text";

const SHOW: Show = { ...USUAL_SHOW, femur: false, patella: false, ligaments: false, raw: false, trails: false, seeThrough: false, map: "plan" };
const FROM_ABOVE = { azimuth: 0, height: 1.25, distance: 165, target: new Vector3(0, -4, -16) };

/** Nothing where the case has no plan, or its knee cannot be loaded or drawn. */
export function PlanPicture({ session }: { session: LiveSession | undefined }) {
  const words = text.teach.train;
  const place = useRef<HTMLDivElement>(null);
  const [knee, setKnee] = useState<Knee>();
  const key = session && `${session.caseName} ${session.caseHash}`;
  useEffect(() => {
    let ended = false;
    setKnee(undefined);
    if (session && key)
      loadKnee(session.caseName, key, session.groups).then((found) => !ended && found.groups.some(({ plan }) => plan.length > 0) && setKnee(found), () => undefined);
    return () => {
      ended = true;
    };
  }, [key]);
  useEffect(() => (knee && place.current ? draw(knee, place.current) : undefined), [knee]);
  return <figure class="plan-picture" hidden={!knee}><div ref={place} /><figcaption>{words.planHint}</figcaption></figure>;
}

function draw(knee: Knee, place: HTMLElement): (() => void) | undefined {
  const joint = new Joint(knee);
  try {
    const view = new View3D(place, joint, text.teach.train.planPicture);
    joint.setShow(SHOW);
    joint.setRow(newRow(), 0);
    view.orbit.put(FROM_ABOVE);
    view.onFrame = (now) => joint.paint(now);
    view.draw();
    return () => {
      view.close();
      joint.dispose();
    };
  } catch (error) {
    joint.dispose();
    if (!(error instanceof NoWebGl)) throw error;
    return undefined;
  }
}
