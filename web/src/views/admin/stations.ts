import { part } from "../../api";
import { explain } from "../../explain";
import { listing } from "../../listing";
import { format, text } from "../../text";
import { toast } from "../../kit/dialog";
import { button, confirm, empty, h, type Child } from "../../ui";
import type { Part } from "../admin";
import { head, showCode } from "./shared";

interface Station {
  name: string;
  case: string;
  trainee: string;
  start: string;
  enrolled: boolean;
  certificate_until_utc_s: number | null;
}

const KEYS = "/etc/arthron/station-keys"; // where docs/INSTALL.md has them
const SOON_S = 30 * 86400;

export const stations: Part = (root, app) => {
  const t = text.admin.stations;
  const code = async (station: Station): Promise<void> => {
    try {
      const made = await app.api.post<{ code: string; until_utc_s: number; port: number }>(`/stations/${part(station.name)}/code`);
      const command = `arthron-station enrol ${location.hostname}:${made.port} ${made.code} --name ${station.name} --keys ${KEYS}`;
      showCode(t.codeTitle(station.name), made.code, t.codeHint(format.time(made.until_utc_s * 1000)), command);
    } catch (error) {
      toast(explain(error), "fault");
    }
  };
  const revoke = (station: Station): void => confirm(t.revokeTitle(station.name), t.revokeHint, t.revoke, async () => {
    await app.api.post(`/stations/${part(station.name)}/revoke`);
    toast(t.revoked(station.name));
    list.reload();
  });
  const list = listing<Station>(text.admin.parts.stations, [
    { label: t.name, cell: (station) => h("b", {}, station.name) },
    { label: t.case, cell: (station) => station.case },
    { label: t.trainee, cell: (station) => station.trainee || format.none },
    { label: t.start, cell: (station) => t.starts[station.start] ?? station.start },
    { label: t.certificate, cell: certificate },
    { label: t.actions, hidden: true, cell: (station) => h("span", { class: "row-actions" },
      button(t.code, () => void code(station), { kind: "quiet", class: "small" }),
      button(t.revoke, () => revoke(station), { kind: "quiet", class: "small", disabled: !station.enrolled })) },
  ], async () => (await app.api.get<{ stations: Station[] }>("/stations")).stations, () => empty(t.none, t.noneHint));
  root.append(head(text.admin.parts.stations, t.hint), list.element);
  return () => list.end();
};

function certificate(station: Station): Child {
  const t = text.admin.stations;
  if (!station.enrolled) return h("span", { class: "badge" }, t.notEnrolled);
  const until = station.certificate_until_utc_s;
  if (!until) return h("span", { class: "badge good" }, t.enrolled);
  const left = until - Date.now() / 1000;
  const kind = left < 0 ? "now" : left < SOON_S ? "act" : "good";
  return h("span", { class: `badge ${kind}` }, (left < 0 ? t.expired : t.until)(format.date(until * 1000)));
}
