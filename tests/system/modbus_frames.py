"""Other people's Modbus frames, good and bad, at the mock-up's real slave: what it answers, and that
it lives on after each."""

import csv
import os
import socket
import struct
import sys
import tempfile
import unittest

from arthron import Process, program, wait_until

DATA = os.environ.get("ARTHRON_DATA") or os.path.join(os.environ["ARTHRON_SOURCE"], "..", "shared", "data")
FRAMES = os.path.join(DATA, "protocol", "modbus_frames.csv")

# The slave of the frames has registers from 0x160 and bits; ours has registers 0 to 37 only,
# so it must answer "no such address" (exception 2) where that one had values.
NOT_IN_OUR_MAP = {
    "read_holding_3": ("8302", "holding registers from 0x160"),
    "read_holding_5_raw_req": ("8302", "holding registers from 0x160"),
    "read_coils_37": ("8102", "coils"),
    "read_input_bits_22": ("8202", "input bits"),
    "read_input_reg_1": ("8402", "input registers"),
    "write_single_reg": ("8602", "a holding register at 0x160"),
    "write_multi_reg_3": ("9002", "holding registers from 0x160"),
}

# A header that lies about the length, or names another protocol, closes the connection.
CLOSED = {"header_len_lie", "protocol_id_nonzero"}


def ask(address, request):
    """The answer to one frame on a connection of its own; nothing where that is closed."""
    with socket.create_connection(address, timeout=10) as line:
        line.sendall(request)
        try:
            return line.recv(300)
        except ConnectionResetError:  # closed with bytes of ours unread
            return b""


def frame(pdu, unit=0x11, transaction=1):
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def rows():
    with open(FRAMES, newline="") as file:
        return list(csv.DictReader(file))


class Frames(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="arthron-modbus-")
        motion = os.path.join(cls.folder.name, "motion.csv")
        with open(motion, "w") as file:
            file.write("t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm,"
                       "punch_tx_mm,punch_ty_mm,punch_tz_mm,punch_qw,punch_qx,punch_qy,punch_qz,punch_valid,"
                       "punch_opening,touch\n")
            for i in range(100):
                file.write(f"{i / 100},30,-2,5,1,0.5,0.25,0,0,0,1,0,0,0,1,0.5,-\n")
        cls.mockup = Process(cls.folder.name, "mockup", program("arthron-mockup"), "--motion", motion,
                             "--modbus-tcp", "127.0.0.1:0", "--slave", "17")
        wait_until("the mock-up's port", lambda: "\n" in cls.mockup.out())
        host, port = cls.mockup.out().split()[1].rsplit(":", 1)
        cls.address = (host, int(port))

    @classmethod
    def tearDownClass(cls):
        code = cls.mockup.end()
        cls.folder.cleanup()
        assert code == 0, code

    def assert_alive(self, standing, row):
        """The joint's values, over a connection that stood all the time and over a new one."""
        request = frame(struct.pack(">BHH", 3, 1, 8))
        values = (3000, -200, 500, 100, 50, 25, 5000, 0)
        wanted = frame(struct.pack(">BB6hHH", 3, 16, *values))
        standing.sendall(request)
        self.assertEqual(standing.recv(300), wanted, row)
        self.assertEqual(ask(self.address, request), wanted, row)

    def check(self, name, expected, answer):
        if name in NOT_IN_OUR_MAP:
            self.assertEqual(answer, frame(bytes.fromhex(NOT_IN_OUR_MAP[name][0])), name)
        elif name in CLOSED:
            self.assertEqual(answer, b"", name)
        elif expected.startswith("exception"):
            self.assertEqual(answer, frame(bytes.fromhex(expected[len("exception"):])), name)
        else:
            self.fail(f"{name}: nobody says what our slave should answer")

    def test_each_frame_gets_its_answer_and_the_slave_lives_on(self):
        with socket.create_connection(self.address, timeout=10) as standing:
            self.assert_alive(standing, "before all")
            for row in rows():
                answer = ask(self.address, bytes.fromhex(row["request_hex"]))
                self.check(row["name"], row["expected"], answer)
                self.assert_alive(standing, row["name"])

    def test_each_frame_cut_short_or_sent_in_pieces_does_no_harm(self):
        with socket.create_connection(self.address, timeout=10) as standing:
            for row in rows():
                request = bytes.fromhex(row["request_hex"])
                for size in range(1, len(request), 3):
                    with socket.create_connection(self.address, timeout=10) as line:
                        line.sendall(request[:size])
                self.assert_alive(standing, row["name"])

    def test_requests_that_our_map_has_are_answered_as_libmodbus_words_them(self):
        """The rows that read and write registers, moved from 0x160 to where ours are."""
        moved = {row["name"]: bytes.fromhex(row["request_hex"].replace("0160", "0001")) for row in rows()}
        answer = ask(self.address, moved["read_holding_3"])
        self.assertEqual(answer, frame(struct.pack(">BB3h", 3, 6, 3000, -200, 500)))
        answer = ask(self.address, moved["read_holding_5_raw_req"])
        self.assertEqual(answer, frame(struct.pack(">BB5h", 3, 10, 3000, -200, 500, 100, 50)))
        self.assertEqual(ask(self.address, moved["write_single_reg"]), moved["write_single_reg"])
        answer = ask(self.address, moved["write_multi_reg_3"])
        self.assertEqual(answer, frame(struct.pack(">BHH", 16, 1, 3)))
        with socket.create_connection(self.address, timeout=10) as standing:
            self.assert_alive(standing, "after writing")  # what is measured cannot be written


if __name__ == "__main__":
    if not os.path.exists(FRAMES):
        print(f"skipped: no {FRAMES} (ARTHRON_DATA names where the data may be)")
        sys.exit(77)
    unittest.main()
