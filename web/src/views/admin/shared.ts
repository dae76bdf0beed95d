import { text } from "../../text";
import { toast } from "../../kit/dialog";
import { button, dialog, h, type Child } from "../../ui";

/** The heading of a part, with what can be done to all of it. */
export function head(title: string, hint: string, ...actions: Child[]): HTMLElement {
  return h("div", { class: "page-head" }, h("div", {}, h("h1", {}, title), h("p", { class: "quiet-text" }, hint)), h("div", { class: "head-actions" }, ...actions));
}

/** A secret that is shown once, and the command that it is for where there is one. */
export function showCode(title: string, code: string, hint: string, command = ""): void {
  const copy = async (): Promise<void> => {
    try {
      await navigator.clipboard.writeText(command || code);
      toast(text.copied);
    } catch {
      toast(text.copyYourself, "fault");
    }
  };
  const secret = command ? h("output", { class: "secret command", tabindex: 0 }, command) : h("output", { class: "secret", tabindex: 0 }, code);
  const shown = dialog(title, [secret, h("p", { class: "quiet-text" }, hint)], [
    button(command ? text.copyCommand : text.copy, () => void copy(), { icon: "copy" }), button(text.done, () => shown.close(), { kind: "primary" })]);
  if (command) shown.element.classList.add("wide");
}
