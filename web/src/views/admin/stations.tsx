import { part } from "../../api";
import { Badge, confirm, Empty, Head, Listing, RowButton, showSecret, toast, toastFault, useLoaded } from "../../kit";
import { format, text } from "../../text";
import type { Part } from "./part";

interface Station {
  name: string;
  case: string;
  trainee: string | null;
  start: string;
  enrolled: boolean;
  certificate_until_utc_s: number | null;
}

const KEYS = "/var/lib/arthron-station/keys"; // where docs/INSTALL.md has them
const SOON_S = 30 * 86400;

export const Stations: Part = ({ app }) => {
  const t = text.admin.stations;
  const list = useLoaded(async () => (await app.api.get<{ stations: Station[] }>("/stations")).stations);
  const code = async ({ name }: Station): Promise<void> => {
    try {
      const made = await app.api.post<{ code: string; until_utc_s: number; port: number }>(`/stations/${part(name)}/code`);
      const command = `runuser -u arthron-station -- arthron-station enrol ${location.hostname}:${made.port} ${made.code} --name ${name} --keys ${KEYS}`;
      showSecret(t.codeTitle(name), made.code, t.codeHint(format.time(made.until_utc_s * 1000)), command);
    } catch (error) {
      toastFault(error);
    }
  };
  const revoke = ({ name }: Station): void => confirm(t.revokeTitle(name), t.revokeHint, t.revoke, async () => {
    await app.api.post(`/stations/${part(name)}/revoke`);
    toast(t.revoked(name));
    list.reload();
  });
  return (
    <>
      <Head title={text.admin.parts.stations} hint={t.hint} />
      <Listing caption={text.admin.parts.stations} of={list} none={<Empty title={t.none} hint={t.noneHint} />} keyOf={(station) => station.name} columns={[
        { label: t.name, cell: (station) => <b>{station.name}</b> },
        { label: t.case, cell: (station) => station.case },
        { label: t.trainee, cell: (station) => station.trainee || format.none },
        { label: t.start, cell: (station) => t.starts[station.start] ?? station.start },
        { label: t.certificate, cell: (station) => <Certificate of={station} /> },
        { label: t.actions, hidden: true, cell: (station) => (
          <span class="row-actions">
            <RowButton onClick={() => void code(station)}>{t.code}</RowButton>
            <RowButton disabled={!station.enrolled} onClick={() => revoke(station)}>{t.revoke}</RowButton>
          </span>) },
      ]} />
    </>
  );
};

function Certificate({ of }: { of: Station }) {
  const t = text.admin.stations;
  if (!of.enrolled) return <Badge>{t.notEnrolled}</Badge>;
  const until = of.certificate_until_utc_s;
  if (!until) return <Badge kind="good">{t.enrolled}</Badge>;
  const left = until - Date.now() / 1000;
  return <Badge kind={left < 0 ? "now" : left < SOON_S ? "act" : "good"}>{(left < 0 ? t.expired : t.until)(format.date(until * 1000))}</Badge>;
}
