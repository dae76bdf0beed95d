#!/usr/bin/env python3
"""The checker of histories on made-up ones: a good one passes, and each kind of fault in it is found."""

import sys
import unittest

sys.dont_write_bytecode = True

from history import Part, Said, Seen, faults_of

MESH = {"meniscus": (3, "abc", 2)}


def at(server, second, part, steps, **more):
    """What was seen of room-1's session within a tenth of a second."""
    values = {"station": "room-1", "session": "s", "protected": True, "tissue": {}, **more}
    return Seen(server=server, begun=second, ended=second + 0.1, part=part, steps=steps, **values)


def part(server, number, begun, ended, **more):
    values = {"station": "room-1", "session": "s", "token": 10 * number, "notes": frozenset(("higher",)), "cuts": 3,
              **more}
    return Part(server=server, number=number, begun=begun, ended=ended, **values)


def good():
    """Server a is lost at 6 s, and b goes on at 20 s."""
    seen = [at("a", second, 1, 100 * second) for second in range(1, 7)]
    seen += [at("b", second, 2, 100 * second) for second in range(20, 26)]
    seen += [at("b", 26, 2, 2600, tissue=MESH), at("b", 29, 2, 2900)]
    return seen, [Said(3, "s", "higher")], [part("a", 1, 0.5, 6), part("b", 2, 20, 29.5)]


class Histories(unittest.TestCase):
    def assert_fault(self, words, seen, said, parts):
        found = faults_of(seen, said, parts)
        self.assertTrue(any(words in fault for fault in found), found)

    def test_a_good_history_passes(self):
        self.assertEqual(faults_of(*good()), [])

    def test_a_server_that_goes_on_behind_the_next_one_is_found(self):
        seen, said, parts = good()
        seen += [at("a", 22, 1, 600), at("a", 27, 1, 601), at("a", 28, 1, 602)]
        self.assert_fault("made steps before and after", seen, said, parts)

    def test_a_lost_server_that_shows_its_last_step_is_none(self):
        seen, said, parts = good()
        seen += [at("a", second, 1, 605) for second in range(20, 29)]  # it had not told of the last five
        self.assertEqual(faults_of(seen, said, parts), [])

    def test_two_that_make_steps_at_one_time_are_found(self):
        seen, said, parts = good()
        seen += [at("a", second, 1, 100 * second) for second in range(7, 29)]
        self.assert_fault("made steps before and after", seen, said, parts)

    def test_one_answer_that_takes_long_proves_nothing(self):
        """A server was frozen within an answer: its steps may have been before."""
        seen, said, parts = good()
        seen.append(at("a", 6.5, 1, 650)._replace(ended=28))
        self.assertEqual(faults_of(seen, said, parts), [])

    def test_steps_at_one_time_in_traces_are_found(self):
        seen, said, _ = good()
        self.assert_fault("at one time", seen, said, [part("a", 1, 0.5, 20.3), part("b", 2, 20, 29.5)])

    def test_steps_of_another_session_at_one_time_are_found(self):
        seen, said, parts = good()
        self.assert_fault("at one time", seen, said, parts + [part("c", 1, 25, 40, session="t")])

    def test_a_part_that_is_missing_or_there_twice_is_found(self):
        seen, said, (first, second) = good()
        self.assert_fault("has the parts [2]", seen, said, [second])
        self.assert_fault("has the parts [1, 2, 2]", seen, said, [first, second, part("c", 2, 40, 41)])

    def test_a_token_that_does_not_rise_is_found(self):
        seen, said, (first, second) = good()
        self.assert_fault("do not rise", seen, said, [first, second._replace(token=10)])

    def test_a_lost_note_is_found(self):
        seen, said, parts = good()
        self.assert_fault("'lower' is lost", seen, said + [Said(3.5, "s", "lower")], parts)

    def test_a_note_that_was_not_protected_may_be_lost(self):
        seen, said, parts = good()
        seen = [s._replace(protected=s.begun < 5) for s in seen]
        self.assertEqual(faults_of(seen, said + [Said(3.5, "s", "lower")], parts), [])

    def test_lost_cuts_are_found(self):
        seen, said, (first, second) = good()
        self.assert_fault("had 2 cuts, the last trace has 1", seen, said, [first, second._replace(cuts=1)])

    def test_cuts_that_were_not_protected_may_be_lost(self):
        seen, said, (first, second) = good()
        seen = [s._replace(protected=s.begun < 26) for s in seen]
        self.assertEqual(faults_of(seen, said, [first, second._replace(cuts=1)]), [])

    def test_another_tissue_at_the_next_server_is_found(self):
        seen, said, parts = good()
        seen.append(at("a", 3, 1, 300, tissue={"meniscus": (3, "abd", 2)}))
        self.assert_fault("mesh 3 of meniscus", seen, said, parts)

    def test_a_cut_that_was_lost_unprotected_may_come_otherwise(self):
        seen, said, parts = good()
        seen = [s._replace(protected=s.part == 2) for s in seen]
        seen.append(at("a", 4, 1, 400, protected=False, tissue={"meniscus": (3, "abd", 2)}))
        self.assertEqual(faults_of(seen, said, parts), [])

    def test_a_new_session_in_place_of_a_safe_one_is_found(self):
        seen, said, parts = good()
        seen += [at("c", 40, 1, 100, session="t")]
        self.assert_fault("t at c came after s", seen, said, parts + [part("c", 1, 39, 41, session="t")])

    def test_a_session_without_any_trace_is_found(self):
        seen, said, _ = good()
        self.assert_fault("s: has no trace", seen, said, [])


if __name__ == "__main__":
    unittest.main()
