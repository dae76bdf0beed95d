// Parts that a cut took off: where they came off, from where water carries them away. They are drawn for a
// moment only, as nobody says where they are after it.
import { BufferAttribute, BufferGeometry, Mesh, Vector3, type Object3D } from "three";
import type { CaseGroup } from "wire";
import type { Piece } from "../mesh";
import { withNormals } from "./anatomy";
import { cutColours } from "./paint";
import { grainOf, tissueMaterial } from "./materials";

export const GONE_MS = 2500;
const SHRINK_MS = 1000; // at the end
const WATER = new Vector3(0.2, 1.6, 0.6); // mm/s, in a bone's frame: forward and up
const SPIN = new Vector3(0.5, 0.8, 0.3).normalize();
const SPIN_RAD_S = 0.7;
const MOST = 64;

interface Part {
  mesh: Mesh;
  centroid: Vector3;
  since: number; // NaN: to be seen for the first time
}

export class DetachedPieces {
  private parts: Part[] = [];

  /** A part of a group that goes with `body`, whose frame it is in. */
  add(piece: Piece, group: CaseGroup, body: Object3D, inside: boolean): void {
    const centroid = new Vector3(...piece.centroid);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(piece.positions.slice(), 3));
    geometry.setAttribute("normal", new BufferAttribute(withNormals(piece.positions, piece.triangles).normals, 3));
    geometry.setAttribute("color", new BufferAttribute(cutColours(group, inside, piece.positions.length / 3), 4, true));
    geometry.setIndex(new BufferAttribute(piece.triangles, 1));
    geometry.translate(-centroid.x, -centroid.y, -centroid.z);
    const mesh = new Mesh(geometry, tissueMaterial({ grain: inside ? grainOf(group) : undefined }));
    mesh.name = "pieces";
    mesh.position.copy(centroid);
    body.add(mesh);
    this.parts.push({ mesh, centroid, since: NaN });
    while (this.parts.length > MOST) drop(this.parts.shift()!);
  }

  /** True while there are any. */
  move(now: number): boolean {
    this.parts = this.parts.filter((part) => {
      if (Number.isNaN(part.since)) part.since = now;
      const age = now - part.since;
      if (age > GONE_MS) drop(part);
      else drift(part, age);
      return age <= GONE_MS;
    });
    return this.parts.length > 0;
  }
}

function drift({ mesh, centroid }: Part, age: number): void {
  mesh.position.copy(centroid).addScaledVector(WATER, age / 1000);
  mesh.quaternion.setFromAxisAngle(SPIN, (SPIN_RAD_S * age) / 1000);
  mesh.scale.setScalar(Math.max(0.01, Math.min(1, (GONE_MS - age) / SHRINK_MS)));
}

function drop({ mesh }: Part): void {
  mesh.removeFromParent();
  mesh.geometry.dispose();
  (mesh.material as ReturnType<typeof tissueMaterial>).dispose();
}
