// Six seconds of a session through its scope, again and again; or what led to its error stands.
import { useEffect, useRef, useState } from "preact/hooks";
import { ScopeReplay } from "../scope_replay";
import type { Source } from "../source";
import { format } from "../text";

interface ClipProps {
  source: Source;
  from: number;
  to: number;
  still: number; // what is shown while it does not play
  playing: boolean;
  label: string;
}

export function Clip({ source, from, to, still, playing, label }: ClipProps) {
  const place = useRef<HTMLDivElement>(null);
  const replay = useRef<ScopeReplay | undefined>(undefined);
  const [time, setTime] = useState(still);
  useEffect(() => {
    const shown = (replay.current = new ScopeReplay(place.current!, source));
    return () => shown.close();
  }, [source]);
  useEffect(() => {
    let frame = 0;
    const begun = performance.now();
    const show = (at: number): void => {
      replay.current!.setTime(at);
      setTime(Math.floor(at * 4) / 4);
    };
    const step = (now: number): void => {
      frame = requestAnimationFrame(step);
      show(from + (((now - begun) / 1000) % Math.max(0.1, to - from)));
    };
    if (playing) frame = requestAnimationFrame(step);
    else show(still);
    return () => cancelAnimationFrame(frame);
  }, [source, from, to, still, playing]);
  return <figure class="clip" aria-label={label}><div class="clip-picture" ref={place} /><figcaption><span>{label}</span><span class="number">{format.tenths(Math.max(time, 0))}</span></figcaption></figure>;
}
