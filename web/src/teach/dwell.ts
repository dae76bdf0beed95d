// A probe that points at keys: its tip moves a cursor, and a key that the cursor stays on is pressed. No DOM.

export const PX_PER_MM = 4;
export const DWELL_MS = 1000;
const GONE_MS = 1000; // a tracker loses a probe for less now and then

/** As a mouse does: the tip's way moves the cursor within an area, wherever the hand began. */
export class Pointer {
  x = NaN; // px from the area's left and top; NaN: no probe was seen yet
  y = NaN;
  private tip: Tip | undefined;

  /** `tip` in the mock-up's frame: it is followed as from before the knee. undefined: the probe is not seen; it is followed from where it was. */
  move(tip: Tip | undefined, width: number, height: number): void {
    const within = (value: number, most: number): number => Math.min(Math.max(value, 0), most);
    if (!tip) return;
    if (!this.tip) [this.x, this.y] = [width / 2, height / 2];
    else {
      this.x = within(this.x - (tip.x - this.tip.x) * PX_PER_MM, width);
      this.y = within(this.y - (tip.z - this.tip.z) * PX_PER_MM, height);
    }
    this.tip = tip;
  }
}

interface Tip {
  x: number; // mm, to the patient's right
  z: number; // proximal
}

/** Tells which key is pressed. One that the cursor was on when it came, or that was pressed, has to be left first. */
export class Dwell<Key> {
  share = 0; // of the time that the cursor has to stay
  private key: Key | undefined;
  private since = Infinity;
  private at = -Infinity; // when the cursor was there last

  /** `seen`: there is a cursor; `key`: what it is on. */
  stay(seen: boolean, key: Key | undefined, now: number): Key | undefined {
    if (!seen) return undefined;
    const came = now - this.at > GONE_MS;
    if (came || key !== this.key) this.since = came ? Infinity : now;
    [this.key, this.at] = [key, now];
    this.share = key === undefined ? 0 : Math.min(1, Math.max(0, (now - this.since) / DWELL_MS));
    if (this.share < 1) return undefined;
    this.since = Infinity;
    this.share = 0;
    return key;
  }
}
