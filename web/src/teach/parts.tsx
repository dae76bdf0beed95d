// What the teaching views share.
import { useEffect, useState } from "preact/hooks";
import { text } from "../text";

/** performance.now(), told anew each `ms` while it is shown. */
export function useTick(ms = 1000): number {
  const [now, setNow] = useState(() => performance.now());
  useEffect(() => {
    const timer = setInterval(() => setNow(performance.now()), ms);
    return () => clearInterval(timer);
  }, [ms]);
  return now;
}

interface BarProps {
  label: string;
  value: number;
  pass: number;
  best: number | undefined;
  words(value: number): string;
}

/** A bar with the pass line and the own best; less is better. */
export function Bar({ label, value, pass, best, words }: BarProps) {
  const t = text.teach;
  const most = Math.max(value, pass, best ?? 0, 1e-9) * 1.15;
  const share = (of: number): string => `${((100 * of) / most).toFixed(1)}%`;
  return (
    <div class="teach-bar" role="group" aria-label={t.barOf(label, words(value), words(pass), best === undefined ? undefined : words(best))}>
      <span class="teach-bar-label">{label}</span>
      <span class="teach-bar-track" aria-hidden="true">
        <i class={`teach-bar-fill ${value <= pass ? "good" : ""}`} style={{ width: share(value) }} />
        <i class="teach-bar-pass" style={{ left: share(pass) }} />
        {best !== undefined && <i class="teach-bar-best" style={{ left: share(best) }} />}
      </span>
      <span class="teach-bar-value number"><b>{words(value)}</b> <span class="quiet-text">{t.passLine(words(pass))}{best !== undefined && ` · ${t.best(words(best))}`}</span></span>
    </div>
  );
}
