// Figures of the equipment and of the method: technicians see them, everybody else asks for them. Kept in the browser.
import { signal } from "@preact/signals";

const KEY = "technical";
let usual = false;
const kept = signal(globalThis.localStorage?.getItem(KEY) ?? null);

/** Whether somebody who has not chosen sees them. */
export function setTechnician(technician: boolean): void {
  usual = technician;
}

export function isTechnical(): boolean {
  return kept.value === null ? usual : kept.value === "true";
}

export function TechnicalSwitch({ label }: { label: string }) {
  const choose = (on: boolean): void => localStorage.setItem(KEY, (kept.value = String(on)));
  return (
    <label class="switch technical-switch">
      <input type="checkbox" checked={isTechnical()} onChange={(event) => choose(event.currentTarget.checked)} /><span>{label}</span>
    </label>
  );
}
