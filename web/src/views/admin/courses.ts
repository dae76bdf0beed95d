import { part } from "../../api";
import type { App } from "../../app";
import { explain } from "../../explain";
import { listing } from "../../listing";
import { routeTo } from "../../router";
import { format, text } from "../../text";
import { toast } from "../../kit/dialog";
import { broken, button, confirm, dialog, empty, field, fill, formDialog, h, loading, select } from "../../ui";
import type { Part } from "../admin";
import { head } from "./shared";

interface Course {
  name: string;
  trainees: number;
  created_utc_s: number;
}

interface Person {
  name: string;
  full_name: string | null;
}

export const courses: Part = (root, app) => {
  const t = text.admin.courses;
  const remove = (course: Course): void => confirm(t.removeTitle(course.name), t.removeHint, t.remove, async () => {
    await app.api.delete(`/courses/${part(course.name)}`);
    list.reload();
  });
  const list = listing<Course>(text.admin.parts.courses, [
    { label: t.name, cell: (course) => h("b", {}, course.name) },
    { label: t.trainees, number: true, cell: (course) => format.number(course.trainees) },
    { label: t.created, cell: (course) => h("span", { class: "number" }, format.date(course.created_utc_s * 1000)) },
    { label: t.actions, hidden: true, cell: (course) => h("span", { class: "row-actions" },
      button(t.people, () => people(app, course.name, list.reload), { kind: "quiet", class: "small" }),
      h("a", { class: "button quiet small", href: routeTo("sessions", [], { course: course.name }) }, t.sessions),
      button(t.rename, () => rename(app, course, list.reload), { kind: "quiet", class: "small" }),
      button(t.remove, () => remove(course), { kind: "quiet", class: "small" })) },
  ], async () => (await app.api.get<{ courses: Course[] }>("/courses")).courses, () => empty(t.none, t.noneHint));
  root.append(head(text.admin.parts.courses, t.hint, button(t.add, () => make(app, list.reload), { kind: "primary", icon: "plus" })), list.element);
  return () => list.end();
};

function make(app: App, made: () => void): void {
  const t = text.admin.courses;
  const name = h("input", { name: "name", maxlength: 63, autocomplete: "off" });
  formDialog(t.add, [field(t.name, name, t.nameHint)], t.add, async () => {
    await app.api.post("/courses", { name: name.value.trim() });
    made();
  });
}

function rename(app: App, course: Course, changed: () => void): void {
  const t = text.admin.courses;
  const name = h("input", { name: "name", value: course.name, maxlength: 63, autocomplete: "off" });
  formDialog(t.renameTitle(course.name), [field(t.name, name, t.nameHint)], text.save, async () => {
    if (name.value.trim() !== course.name) await app.api.patch(`/courses/${part(course.name)}`, { name: name.value.trim() });
    changed();
  });
}

// The trainees of a course: add one, remove one.
function people(app: App, course: string, changed: () => void): void {
  const t = text.admin.courses;
  const body = h("div", { class: "people" }, loading());
  let different = false;
  dialog(t.peopleOf(course), [body], [], () => different && changed());
  const called = (person: Person): string => (person.full_name ? `${person.full_name} (${person.name})` : person.name);
  const show = async (): Promise<void> => {
    const [inside, all] = await Promise.all([
      app.api.get<{ course: { trainees: Person[] } }>(`/courses/${part(course)}`), app.api.get<{ trainees: (Person & { erased: boolean })[] }>("/trainees")]);
    const members = inside.course.trainees;
    const others = all.trainees.filter((one) => !one.erased && !members.some((member) => member.name === one.name));
    const choice = select([["", t.choose], ...others.map((one): [string, string] => [one.name, called(one)])]);
    const change = async (request: () => Promise<void>): Promise<void> => {
      try {
        await request();
        different = true;
        await show();
        body.querySelector("select")?.focus();
      } catch (error) {
        toast(explain(error), "fault");
      }
    };
    const membersPath = `/courses/${part(course)}/trainees`;
    const enter = (): void => void (choice.value && change(() => app.api.post(membersPath, { trainee: choice.value })));
    const leave = (member: Person): HTMLElement => button(t.leave, () => void change(() => app.api.delete(`${membersPath}/${part(member.name)}`)),
      { kind: "quiet", class: "small", "aria-label": t.leaveLabel(called(member)) });
    fill(body, members.length ? h("ul", { class: "names" }, ...members.map((member) => h("li", {}, h("span", {}, called(member)), leave(member)))) : empty(t.nobody),
      h("div", { class: "enter" }, field(t.enter, choice), button(t.enter, enter, { kind: "primary" })));
  };
  show().catch((error: unknown) => fill(body, broken(text.listBroken, explain(error))));
}
