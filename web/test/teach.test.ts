// What the teaching pages reckon without a browser: rules of attention, errors to look at, plans, sight.
import assert from "node:assert/strict";
import { test } from "node:test";
import { create, toBinary, type MessageInitShape } from "@bufbuild/protobuf";
import { AttemptStateSchema, LiveBatchSchema, LiveSessionSchema, MomentSchema, ReplayProgressSchema } from "wire";
import { FeedSource } from "../src/source";
import { levels, missing, sum, SUM_MOST, type Scores, DOMAINS } from "../src/teach/asset";
import { casesOf, clipAround, clipUntil, pursued, StepTimes, worst, type Today } from "../src/teach/model";
import { sentencesOf } from "../src/teach/limits_words";
import { add, move, remove, weeksOf } from "../src/teach/plan";
import { stateOf, type Cell } from "../src/teach/progress";
import { quantile } from "../src/teach/quantile";
import { Attention, SNOOZE_MS, USUAL_LIMITS, type Observed } from "../src/teach/rules";
import { text } from "../src/text";
import { sees } from "../src/teach/sight";

const attempt = { number: 1, task: "probe-in-order", title: "Probing", ended: false, time_s: 10, met: 0 };
const observed = (of: Partial<Observed> = {}): Observed => ({ station: "room-1", trainee: "anna", attempt, paused: false, helpAsked: false, ...of });
const rules = (rows: { rule: string }[]): string[] => rows.map(({ rule }) => rule);

test("a tool out of view is told after thirty seconds, and not where it came into view meanwhile", () => {
  const attention = new Attention();
  assert.deepEqual(attention.update(0, [observed({ unseen: true })]), []);
  assert.deepEqual(attention.update(29_900, [observed({ unseen: true })]), []);
  assert.deepEqual(rules(attention.update(30_000, [observed({ unseen: true })])), ["unseen"]);
  const other = new Attention();
  other.update(0, [observed({ unseen: true })]);
  other.update(20_000, [observed({ unseen: false })]);
  other.update(20_100, [observed({ unseen: true })]);
  assert.deepEqual(other.update(31_000, [observed({ unseen: true })]), []);
});

test("a row that is shown does not flicker, and goes into the history", () => {
  const attention = new Attention();
  attention.update(0, [observed({ deepMm: 1.2 })]);
  assert.deepEqual(rules(attention.update(2000, [observed({ deepMm: 1.1 })])), ["deep"]);
  assert.deepEqual(rules(attention.update(2500, [observed({ deepMm: 0 })])), ["deep"]);
  assert.equal(attention.update(3000, [observed({ deepMm: 0.2 })])[0]!.value, 1.2);
  assert.deepEqual(attention.update(12_600, [observed({ deepMm: 0 })]), []);
  assert.deepEqual(rules(attention.history), ["deep"]);
});

test("no progress is counted in the attempt's time, and a goal ends it", () => {
  const attention = new Attention();
  const at = (now: number, time_s: number, met: number): string[] => rules(attention.update(now, [observed({ attempt: { ...attempt, time_s, met } })]));
  at(0, 0, 0);
  assert.deepEqual(at(400_000, 170, 0), []); // it was paused in between
  assert.deepEqual(at(410_000, 180, 0), ["stuck"]);
  at(411_000, 181, 1);
  assert.deepEqual(at(412_500, 182, 1), []);
});

test("who is paused struggles no more, who asks comes first, and what is snoozed comes back", () => {
  const attention = new Attention();
  const both = [observed({ beyondShare: 0.3 }), observed({ station: "room-2", trainee: "bert", helpAsked: true })];
  assert.deepEqual(attention.update(0, both).map(({ group }) => group), ["asks", "struggles"]);
  attention.snooze(attention.update(1, both)[0]!.key, 1);
  assert.deepEqual(rules(attention.update(2, both)), ["beyond"]);
  assert.deepEqual(rules(attention.update(SNOOZE_MS + 2, both)), ["help", "beyond"]);
  attention.update(SNOOZE_MS + 3, [observed({ beyondShare: 0.3, paused: true })]);
  assert.deepEqual(attention.update(SNOOZE_MS + 6000, [observed({ beyondShare: 0.3, paused: true })]), []);
});

test("a cut into the outer third is told by the limit of the task, with the most that was cut", () => {
  const attention = new Attention((task) => ({ ...USUAL_LIMITS, outerMm3: task === "repair" ? 1 : 5 }));
  const of = (outerMm3: number, task: string): Observed => observed({ outerMm3, attempt: { ...attempt, task } });
  assert.deepEqual(attention.update(0, [of(3, "resection")]), []);
  assert.deepEqual(attention.update(1, [of(3, "repair")]).map(({ rule, value }) => [rule, value]), [["outer", 3]]);
  assert.deepEqual(attention.update(2, [of(4, "repair")]).map(({ value }) => value), [4]);
});

test("one and a half times the usual time, and the end of an attempt, are told", () => {
  const attention = new Attention();
  const of = (time_s: number, ended = false): Observed => observed({ attempt: { ...attempt, time_s, ended, medianS: 100, met: 1, ...(ended ? { passed: true } : {}) } });
  assert.deepEqual(attention.update(0, [of(150)]), []);
  assert.deepEqual(rules(attention.update(1000, [of(151)])), ["slow"]);
  assert.deepEqual(rules(attention.update(9000, [of(152, true)])).includes("finished"), true);
});

test("the worst errors are sentinels, then one of each, the most frequent first", () => {
  const of = (error: string, time_s: number) => ({ error, tool: "Probe", step: time_s * 100, time_s });
  const all = { errors: [{ name: "deep", count: 1, sentinel: false }, { name: "unseen", count: 3, sentinel: false }, { name: "ligament", count: 1, sentinel: true }],
    occurrences: [of("unseen", 1), of("unseen", 2), of("deep", 3), of("unseen", 4), of("ligament", 5)] };
  assert.deepEqual(worst(all).map(({ error, time_s }) => [error, time_s]), [["ligament", 5], ["unseen", 1], ["deep", 3]]);
});

test("a step lies between the moments beside it, and a clip within the session", () => {
  const steps = new StepTimes();
  assert.ok(Number.isNaN(steps.at(5)));
  for (const [step, time] of [[10, 1], [20, 2], [40, 3]] as const) steps.add(step, time);
  assert.deepEqual([steps.at(1), steps.at(15), steps.at(30), steps.at(99)], [1, 1.5, 2.5, 3]);
  assert.deepEqual(clipAround(10, 0, 60), { from: 6, to: 12 });
  assert.deepEqual(clipAround(1, 0, 60), { from: 0, to: 6 });
  assert.deepEqual(clipAround(60, 0, 60), { from: 54, to: 60 });
  assert.deepEqual(clipAround(1, 0, 2), { from: 0, to: 2 });
});

test("a plan opens each task after the one before, and nothing waits for what was removed", () => {
  const plan = add(add(add([], "a", 1), "b", 1), "c", 2);
  assert.deepEqual(plan.map(({ task, after }) => [task, after]), [["a", []], ["b", ["a"]], ["c", ["b"]]]);
  assert.deepEqual(remove(plan, "b").map(({ task, after }) => [task, after]), [["a", []], ["c", []]]);
  assert.deepEqual(move(plan, "c", 9, 4).map(({ week }) => week), [1, 1, 4]);
  assert.deepEqual(weeksOf(plan, 3).map(({ tasks }) => tasks.length), [2, 1, 0]);
});

test("a task counts on the cases that its courses ask for, and on all where one asks for none", () => {
  const step = (task: string, ...cases: string[]) => ({ task, cases });
  const today = (...courses: { task: string; cases: string[] }[][]) => ({ courses: courses.map((steps) => ({ steps })), exams: [] }) as unknown as Today;
  assert.deepEqual(casesOf(today([step("look", "healthy"), step("cut", "torn")], [step("look", "arthrosis", "healthy")]), "look"), ["healthy", "arthrosis"]);
  assert.deepEqual(casesOf(today([step("look", "healthy")], [step("look")]), "look"), []);
  assert.deepEqual(casesOf(today([step("cut", "torn")]), "look"), []);
});

test("a cell shows the exam first, and what is overdue before what is tried", () => {
  const cell: Cell = { state: "trying", locked: false, overdue: true, attempts: 2, best_s: null, exam: null };
  assert.deepEqual([stateOf(cell), stateOf({ ...cell, exam: "begun" }), stateOf({ ...cell, state: "passed" }), stateOf({ ...cell, overdue: false })], ["overdue", "exam", "passed", "trying"]);
});

test("the form's sum is 38 at most, and autonomy goes to 3", () => {
  const best: Scores = Object.fromEntries(DOMAINS.map((domain) => [domain, levels(domain).at(-1)!]));
  assert.equal(sum(best), SUM_MOST);
  assert.deepEqual(levels("autonomy"), [1, 2, 3]);
  assert.deepEqual(missing({ ...best, flow: undefined } as Scores), ["flow"]);
});

test("an optic sees along its tilt, up to half its field", () => {
  const scope = { q: [1, 0, 0, 0], t: [0, 0, 0] };
  const tip = (y: number, z: number) => ({ q: [1, 0, 0, 0], t: [0, y, z] });
  const straight = { tiltDeg: 0, fieldDeg: 90, postDeg: 0 };
  assert.equal(sees(scope, straight, tip(0, 20)), true);
  assert.equal(sees(scope, straight, tip(21, 20)), false);
  assert.equal(sees(scope, straight, tip(0, -20)), false);
  const tilted = { tiltDeg: 70, fieldDeg: 90, postDeg: 0 };
  assert.deepEqual([sees(scope, tilted, tip(20, 2)), sees(scope, tilted, tip(0, 20))], [true, false]);
});

test("what a goal asks is told in sentences, in one order, and an unknown number not at all", () => {
  assert.deepEqual(sentencesOf({ hold_s: 1, rim_mm: 3, under_share: 0.2, other: 4 }), ["left to remove: at most 20 % of the plan", "thinnest remaining rim: at least 3 mm", "held for 1 s"]);
  assert.deepEqual(sentencesOf({ flexion_from_deg: 60, flexion_to_deg: 100 }), ["flexed 60 to 100°"]);
  assert.deepEqual(sentencesOf({ over_share: 0.3, for_s: 8 }, text.teach.errorLimits), ["removed too much: over 30 % of the plan", "for 8 s"]);
});

test("a quantile lies between its neighbours", () => {
  assert.equal(quantile([4, 1, 3, 2], 0.5), 2.5);
  assert.ok(Number.isNaN(quantile([], 0.5)));
});

test("beside an error stands the goal that was pursued then, and the expert's six seconds up to it", () => {
  const goals = [{ name: "horn", met_s: 12 }, { name: "body", met_s: 5 }, { name: "root", met_s: null }, { name: "rim", met_s: null }];
  assert.deepEqual([3, 8, 12, 13].map((time) => pursued({ goals }, time)), ["body", "horn", "horn", "root"]);
  assert.equal(pursued({ goals: goals.slice(0, 2) }, 30), "body", "the error came after all goals");
  assert.equal(pursued({ goals: [] }, 3), undefined);
  assert.deepEqual(clipUntil(20, 0, 60), { from: 14, to: 20 });
  assert.deepEqual(clipUntil(2, 0, 60), { from: 0, to: 6 });
  assert.deepEqual(clipUntil(70, 0, 60), { from: 54, to: 60 });
});

test("a batch is a whole session: its moments, and the attempt with the goals that were met", () => {
  const session = create(LiveSessionSchema, { recorded: true, caseName: "healthy", caseHash: 7n });
  const moments = [0, 1, 2].map((s) => create(MomentSchema, { step: BigInt(s + 1), timeNs: BigInt(s) * 1_000_000_000n, state: 1 }));
  const attempt = create(AttemptStateSchema, { number: 1, task: "probing", version: 3, goals: [{ name: "horn", metNs: 1_500_000_000n }] });
  const items = [{ message: { case: "session", value: session } }, ...moments.map((value) => ({ message: { case: "moment", value } })), { message: { case: "attempt", value: attempt } },
    { message: { case: "progress", value: create(ReplayProgressSchema, { share: 1, done: true }) } }] as MessageInitShape<typeof LiveBatchSchema>["items"];
  const bytes = toBinary(LiveBatchSchema, create(LiveBatchSchema, { items: items! }));
  const { source, attempt: told } = FeedSource.batch(bytes)!;
  assert.deepEqual([source.session?.caseHash, source.history.count, source.history.end, source.progress], [7n, 3, 2, 1]);
  assert.deepEqual([told?.version, told?.goals[0]?.metNs], [3, 1_500_000_000n]);
  assert.equal(FeedSource.batch(bytes.subarray(0, bytes.length - 3)), undefined, "cut short");
});
