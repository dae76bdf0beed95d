import { ApiError, Unreachable } from "./api";
import { NoAnswer } from "./live";
import { text } from "./text";

/** The text of an error for a person. */
export function explain(error: unknown): string {
  if (error instanceof Unreachable) return text.errors.unreachable;
  if (error instanceof NoAnswer) return error.sent ? text.errors.noAnswer : text.errors.notSent;
  if (error instanceof ApiError) return text.errors.codes[error.code]?.(error.retryAfterS) ?? (error.message || text.errors.status(error.status));
  return error instanceof Error ? error.message : String(error);
}
