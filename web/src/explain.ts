import { Why_Code, type Why } from "wire";
import { ApiError, Unreachable } from "./api";
import { NoAnswer } from "./live";
import { sentence, text } from "./text";

/** The text of an error for a person. */
export function explain(error: unknown): string {
  if (error instanceof Unreachable) return text.errors.unreachable;
  if (error instanceof NoAnswer) return error.sent ? text.errors.noAnswer : text.errors.notSent;
  if (error instanceof ApiError) return text.errors.codes[error.code]?.(error.retryAfterS) ?? (error.message || text.errors.status(error.status));
  return error instanceof Error ? error.message : String(error);
}

/** The sentence of a code; of one that this page does not know, what the server says. */
export function whyOf(why: Why | undefined, said: string): string {
  const known = why && text.whys[Why_Code[why.code] ?? ""];
  return known ? known(why.parameters[0] ?? "", why.parameters[1] ?? "") : sentence(said);
}
