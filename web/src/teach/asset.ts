// The ASSET form: eight domains on Dreyfus levels. Who has at least 3 in each is competent.

export const DOMAINS = ["safety", "field_of_view", "camera_dexterity", "instrument_dexterity", "bimanual_dexterity", "flow", "quality", "autonomy"] as const;
export type Domain = (typeof DOMAINS)[number];
export type Scores = Partial<Record<Domain, number>>;

const MOST = 5;
const AUTONOMY_MOST = 3;
export const SUM_MOST = 38;

export const levels = (domain: Domain): number[] => Array.from({ length: domain === "autonomy" ? AUTONOMY_MOST : MOST }, (_, i) => i + 1);
export const sum = (scores: Scores): number => DOMAINS.reduce((total, domain) => total + (scores[domain] ?? 0), 0);
export const missing = (scores: Scores): Domain[] => DOMAINS.filter((domain) => scores[domain] === undefined);
