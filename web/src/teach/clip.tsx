// Six seconds of a session through its scope, again and again; or what led to its error stands.
import { useEffect, useState } from "preact/hooks";
import { ScopeReplay } from "../scope_replay";
import type { Source } from "../source";
import { format } from "../text";

export interface ClipProps {
  source: Source;
  from: number;
  to: number;
  still: number; // what is shown while it does not play
  playing: boolean;
  label: string;
}

export function Clip({ source, from, to, still, playing, label }: ClipProps) {
  const [time, setTime] = useState(still);
  useEffect(() => {
    let frame = 0;
    const begun = performance.now();
    const step = (now: number): void => {
      frame = requestAnimationFrame(step);
      setTime(from + ((Math.max(0, now - begun) / 1000) % Math.max(0.1, to - from)));
    };
    if (playing) frame = requestAnimationFrame(step);
    else setTime(still);
    return () => cancelAnimationFrame(frame);
  }, [source, from, to, still, playing]);
  const told = Math.max(0, Math.floor(time * 4) / 4);
  return <figure class="clip" aria-label={label}><div class="clip-picture"><ScopeReplay source={source} time={time} /></div><figcaption><span>{label}</span><span class="number">{format.tenths(told)}</span></figcaption></figure>;
}
