// Figures of the equipment and of the method: technicians see them, everybody else asks for them. Kept in the browser.
import { h } from "./ui";

const KEY = "technical";
let usual = false;

/** Whether somebody who has not chosen sees them. */
export function setTechnician(technician: boolean): void {
  usual = technician;
}

export function isTechnical(): boolean {
  const kept = localStorage.getItem(KEY);
  return kept === null ? usual : kept === "true";
}

export function technicalSwitch(label: string, changed: (on: boolean) => void): HTMLElement {
  const box = h("input", { type: "checkbox", on: { change: () => {
    localStorage.setItem(KEY, String(box.checked));
    changed(box.checked);
  } } });
  box.checked = isTechnical();
  return h("label", { class: "switch technical-switch" }, box, h("span", {}, label));
}
