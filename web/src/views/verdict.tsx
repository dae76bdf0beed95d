import { Badge } from "../kit";
import { text } from "../text";

/** A verdict by sign and word; null: it is withheld. */
export function VerdictBadge({ verdict }: { verdict: "passed" | "not yet" | null }) {
  if (verdict === null) return <span class="quiet-text">{text.teach.exam.withheld}</span>;
  return <Badge kind={verdict === "passed" ? "good" : "act"} icon={verdict === "passed" ? "quiet" : "waiting"}>{text.teach.verdicts[verdict]}</Badge>;
}
