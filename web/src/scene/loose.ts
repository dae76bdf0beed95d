// Loose bodies: ellipsoids of cartilage that lie in the patient's joint, or in the jaw that holds them.
import { Group, Matrix4, Mesh, Quaternion, SphereGeometry, Vector3 } from "three";
import { CaseGroup_Kind, CaseGroupSchema, LooseMoment_State, type LooseBody } from "wire";
import { create } from "@bufbuild/protobuf";
import { BODIES, bodyAt, HAS_WARPED, INSTRUMENTS, LOOSE, LOOSE_ON, LOOSE_POSE, LOOSE_STATE, looseAt, toolAt, WARPED, type Row } from "../history";
import { FIRST_INSTRUMENT } from "../instruments";
import { grainOf, tissueMaterial } from "./materials";

const COLOUR = 0xf4ead6;
const OUT = 1 + LooseMoment_State.OUT;

const position = new Vector3();
const rotation = new Quaternion();
const scale = new Vector3();
const one = new Vector3(1, 1, 1);
const here = new Matrix4();
const before = new Matrix4();

function matrixAt(row: Row, at: number, out: Matrix4): Matrix4 {
  rotation.set(row[at + 1]!, row[at + 2]!, row[at + 3]!, row[at]!).normalize();
  return out.compose(position.set(row[at + 4]!, row[at + 5]!, row[at + 6]!), rotation, one);
}

export class LooseBodies {
  readonly root = new Group();
  private shown: readonly LooseBody[] = [];

  constructor(private readonly inScope: boolean) {}

  set(bodies: readonly LooseBody[]): void {
    if (bodies === this.shown || (!bodies.length && !this.shown.length)) return;
    this.shown = bodies;
    for (const node of [...this.root.children] as Mesh[]) {
      node.removeFromParent();
      node.geometry.dispose();
      (node.material as ReturnType<typeof tissueMaterial>).dispose();
    }
    const cartilage = create(CaseGroupSchema, { kind: CaseGroup_Kind.CARTILAGE });
    for (const { radiiMm: [x = 1, y = 1, z = 1] } of bodies) {
      const geometry = new SphereGeometry(1, 24, 16).applyMatrix4(new Matrix4().makeScale(x, y, z));
      const mesh = new Mesh(geometry, tissueMaterial({ colour: COLOUR, grain: this.inScope ? grainOf(cartilage) : undefined }));
      mesh.name = "loose";
      mesh.matrixAutoUpdate = false;
      mesh.visible = false;
      mesh.castShadow = mesh.receiveShadow = true;
      this.root.add(mesh);
    }
  }

  /** One that is out of the knee is not seen any more. */
  move(row: Row): void {
    this.root.children.forEach((node, body) => {
      const at = looseAt(body);
      const state = row[at + LOOSE_STATE]!;
      node.visible = state > 0 && state !== OUT;
      if (!node.visible) return;
      matrixAt(row, at + LOOSE_POSE, node.matrix);
      node.matrixWorldNeedsUpdate = true;
    });
  }
}

// Where a row has what carries a loose body; -1: it is not seen.
function carrierAt(row: Row, on: number): number {
  if (on < BODIES) return bodyAt(on, true);
  const instrument = on - FIRST_INSTRUMENT;
  if (instrument < 0 || instrument >= INSTRUMENTS || row[toolAt(instrument) + HAS_WARPED] !== 1) return -1;
  return toolAt(instrument) + WARPED;
}

/** Loose bodies of a row, taken along to where another row has what carries them. */
export function carryLoose(from: Row, to: Row): void {
  for (let body = 0; body < LOOSE; body++) {
    const at = looseAt(body);
    to[at + LOOSE_STATE] = from[at + LOOSE_STATE]!;
    to[at + LOOSE_ON] = from[at + LOOSE_ON]!;
    if (!from[at + LOOSE_STATE]) continue;
    to.set(from.subarray(at + LOOSE_POSE, looseAt(body + 1)), at + LOOSE_POSE);
    const [then, now] = [carrierAt(from, from[at + LOOSE_ON]!), carrierAt(to, from[at + LOOSE_ON]!)];
    if (then < 0 || now < 0 || from[at + LOOSE_STATE] === OUT) continue;
    matrixAt(from, then, before).invert().multiply(matrixAt(from, at + LOOSE_POSE, here));
    matrixAt(to, now, here).multiply(before).decompose(position, rotation, scale);
    to.set([rotation.w, rotation.x, rotation.y, rotation.z, position.x, position.y, position.z], at + LOOSE_POSE);
  }
}
