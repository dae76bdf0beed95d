// What pages show of a group follows from what the server tells of it, never from its name.
import assert from "node:assert/strict";
import { test } from "node:test";
import { CaseGroup_Kind, CaseGroup_Side } from "wire";
import { groupOf, labelOf } from "../src/groups";
import { subjectName } from "../src/panels";
import { grainOf, tissueOf } from "../src/scene/materials";
import { told } from "./told";

const { BONE, LIGAMENT, MENISCUS, OTHER, SYNOVIUM } = CaseGroup_Kind;

test("a group has the label and the colour that are told", () => {
  const groups = [told("meniscus_medial", SYNOVIUM, { label: "Medial plica", colour: 0xe05a5a })];
  assert.equal(labelOf(groups, "meniscus_medial"), "Medial plica");
  assert.deepEqual(tissueOf(groups[0]!, false, false, false), [0xe0, 0x5a, 0x5a]);
  assert.equal(subjectName("probe-2 meniscus_medial", groups), "Probe 2, medial plica");
});

test("one that nothing is told of is called by its name", () => {
  assert.equal(labelOf(undefined, "meniscus_root"), "Meniscus root");
  assert.equal(groupOf([], "labrum").kind, OTHER);
});

test("in the scope a tissue looks as its kind does, but for a colour of the case's own", () => {
  const inside = (kind: CaseGroup_Kind, more = {}): string => tissueOf(told("x", kind, more), true, false, false).join();
  assert.equal(new Set([inside(BONE), inside(MENISCUS), inside(LIGAMENT), inside(SYNOVIUM)]).size, 4);
  assert.equal(inside(LIGAMENT, { side: CaseGroup_Side.MEDIAL }), inside(SYNOVIUM)); // a collateral one is behind the lining
  assert.equal(inside(SYNOVIUM, { ownColour: true, colour: 0x010203 }), "1,2,3");
  assert.notDeepEqual(grainOf(told("meniscus_medial", SYNOVIUM)), grainOf(told("plica", MENISCUS)));
});
