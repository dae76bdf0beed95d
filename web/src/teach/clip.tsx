// Six seconds of a session through its scope, again and again.
import { useEffect, useRef, useState } from "preact/hooks";
import { ScopeReplay } from "../scope_replay";
import type { Source } from "../source";
import { format } from "../text";

export function Clip({ source, from, to, label }: { source: Source; from: number; to: number; label: string }) {
  const place = useRef<HTMLDivElement>(null);
  const [time, setTime] = useState(from);
  useEffect(() => {
    const replay = new ScopeReplay(place.current!, source);
    const begun = performance.now();
    let frame = 0;
    const step = (now: number): void => {
      frame = requestAnimationFrame(step);
      const at = from + (((now - begun) / 1000) % Math.max(0.1, to - from));
      replay.setTime(at);
      setTime(Math.floor(at * 4) / 4);
    };
    frame = requestAnimationFrame(step);
    return () => {
      cancelAnimationFrame(frame);
      replay.close();
    };
  }, [source, from, to]);
  return <figure class="clip" aria-label={label}><div class="clip-picture" ref={place} /><figcaption><span>{label}</span><span class="number">{format.tenths(Math.max(time, 0))}</span></figcaption></figure>;
}
