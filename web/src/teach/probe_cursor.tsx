// The cursor of a probe over keys: of the station on this PC, which tells its poses before anybody signs in.
import { useLayoutEffect, useRef } from "preact/hooks";
import { Validity } from "wire";
import { StationView, type ViewAddress } from "../station_view";
import { Dwell, Pointer } from "./dwell";

const PROBE = "probe";

/** Presses the buttons that stand beside it. `told`: whether the probe is seen, where that changes. */
export function ProbeCursor({ place, told }: { place: ViewAddress; told(seen: boolean): void }) {
  const cursor = useRef<HTMLElement>(null);
  useLayoutEffect(() => {
    const element = cursor.current!;
    const [station, pointer, dwell] = [new StationView(place), new Pointer(), new Dwell<HTMLElement>()];
    let pending = 0;
    const follow = (now: number): void => {
      pending = requestAnimationFrame(follow);
      const area = element.parentElement!;
      const tip = tipOf(station);
      pointer.move(tip, area.clientWidth, area.clientHeight);
      if (element.hidden !== !tip) told(!(element.hidden = !tip));
      dwell.stay(tip !== undefined, [...area.querySelectorAll("button")].find((key) => isOn(pointer, key)), now)?.click();
      element.style.translate = `${pointer.x}px ${pointer.y}px`;
      element.style.setProperty("--share", String(dwell.share));
    };
    follow(performance.now());
    return () => {
      cancelAnimationFrame(pending);
      station.close();
    };
  }, []);
  return <i class="probe-cursor" ref={cursor} hidden aria-hidden="true" />;
}

function tipOf({ fresh, newest }: StationView) {
  const probe = fresh ? newest!.instruments.find(({ name }) => name === PROBE) : undefined;
  return probe && probe.validity !== Validity.LOST ? probe.tip : undefined;
}

const isOn = ({ x, y }: Pointer, { offsetLeft: left, offsetTop: top, offsetWidth: width, offsetHeight: height }: HTMLElement): boolean =>
  x >= left && x <= left + width && y >= top && y <= top + height;
