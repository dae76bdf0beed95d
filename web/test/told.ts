// Groups as a server tells them, for tests.
import { create } from "@bufbuild/protobuf";
import { CaseGroup_Kind, CaseGroupSchema, type CaseGroup } from "wire";

export function told(name: string, kind = CaseGroup_Kind.OTHER, more: Partial<Omit<CaseGroup, "$typeName">> = {}): CaseGroup {
  return create(CaseGroupSchema, { name, kind, label: name, colour: 0x808080, hasZones: kind === CaseGroup_Kind.MENISCUS, ...more });
}
