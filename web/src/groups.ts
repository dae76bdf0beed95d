// The groups of a case, as the server tells with a session what each of them is.
import { create } from "@bufbuild/protobuf";
import { CaseGroup_Kind, CaseGroup_Side, CaseGroupSchema, type CaseGroup } from "wire";
import { text } from "./text";

export type Groups = readonly CaseGroup[];

const UNKNOWN = 0xdbb3a3;

/** What a name says to people: "meniscus_root" is "Meniscus root". */
export function nameInWords(name: string): string {
  return name.charAt(0).toUpperCase() + name.slice(1).replace(/[-_]/g, " ");
}

/** One that nothing is told of has its name as label. */
export function groupOf(groups: Groups | undefined, name: string): CaseGroup {
  return groups?.find((group) => group.name === name) ??
    create(CaseGroupSchema, { name, kind: CaseGroup_Kind.OTHER, label: nameInWords(name), colour: UNKNOWN, hasZones: true });
}

export function labelOf(groups: Groups | undefined, name: string): string {
  return groupOf(groups, name).label;
}

/** As short as a plot's key: of a meniscus its side is enough. */
export function shortLabelOf(group: CaseGroup): string {
  const side = { [CaseGroup_Side.MEDIAL]: text.session.medial, [CaseGroup_Side.LATERAL]: text.session.lateral, [CaseGroup_Side.NONE]: "" }[group.side];
  return (group.kind === CaseGroup_Kind.MENISCUS && side) || group.label;
}

export function isSkin(group: CaseGroup): boolean {
  return group.kind === CaseGroup_Kind.SKIN;
}
