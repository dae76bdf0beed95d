import { part } from "../../api";
import type { App } from "../../app";
import { listing } from "../../listing";
import { routeTo } from "../../router";
import { format, text } from "../../text";
import { broken, button, dialog, empty, explain, field, fill, formDialog, h, loading, select, toast } from "../../ui";
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
  const list = listing<Course>(text.admin.parts.courses, [
    { label: t.name, cell: (course) => h("b", {}, course.name) },
    { label: t.trainees, number: true, cell: (course) => format.number(course.trainees) },
    { label: t.created, cell: (course) => h("span", { class: "number" }, format.date(course.created_utc_s * 1000)) },
    { label: t.actions, hidden: true, cell: (course) => h("span", { class: "row-actions" },
      button(t.people, () => people(app, course.name, list.reload), { kind: "quiet", class: "small" }),
      h("a", { class: "button quiet small", href: routeTo("sessions", [], { course: course.name }) }, t.sessions)) },
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

// Who is in a course, and one more.
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
    const enter = async (): Promise<void> => {
      if (!choice.value) return;
      await app.api.post(`/courses/${part(course)}/trainees`, { trainee: choice.value });
      different = true;
      await show();
      body.querySelector("select")?.focus();
    };
    fill(body, members.length ? h("ul", { class: "names" }, ...members.map((member) => h("li", {}, called(member)))) : empty(t.nobody),
      h("div", { class: "enter" }, field(t.enter, choice), button(t.enter, () => void enter().catch((error) => toast(explain(error), "fault")), { kind: "primary" })));
  };
  show().catch((error: unknown) => fill(body, broken(text.listBroken, explain(error))));
}
