"""`conformance/run` on decoders that are right and wrong."""

import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from common import CONFORMANCE, packets_of

HASH = "283fa03e97036955"


class Runner(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)
        shutil.copy(CONFORMANCE / "run", self.folder / "run")
        (self.folder / "refused").mkdir()
        (self.folder / "hashes.txt").write_text(f"good.isv 0 {HASH}\ngood.isv 1 {HASH[::-1]}\n")
        (self.folder / "refused.txt").write_text("wrong.isv 1 cut\n")
        (self.folder / "good.isv").write_text(f"0 {HASH}\n1 {HASH[::-1]}\n")
        (self.folder / "refused" / "wrong.isv").write_text(f"0 {HASH}\nrefused cut\n")

    def run_with(self, *decoder):
        """Exit status and output. The streams of this test hold what a right decoder prints, so `cat` is one."""
        command = [sys.executable, str(self.folder / "run"), "--timeout", "2", *decoder]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        return done.returncode, done.stdout

    def test_a_right_decoder_passes(self):
        status, output = self.run_with("cat")
        self.assertEqual(status, 0, output)
        self.assertIn("2 of 2", output)

    def test_one_stream_can_be_chosen(self):
        self.assertIn("1 of 1", self.run_with("--only", "refused", "cat")[1])
        self.assertEqual(self.run_with("--only", "none", "cat")[0], 1)

    def test_wrong_decoders_fail(self):
        for script, why in [
            ("head -n 1", "found the end"),
            ("sed s/283/284/", "expected 0 283f"),
            ("sed s/cut/limit/", "expected refused cut, found refused limit"),
            ("sed /cut/d", "expected refused cut, found the end"),
            ("sed s/^0/1/", "found 1 283f"),
            ("sed '$aextra'", "found extra"),
            ("tr a-f A-F <", "found 0 283FA"),
            ("sleep 9;", "no end within 2 s"),
            ("kill -9 $$;", "exit status -9"),
            ("exit 3;", "exit status 3"),
        ]:
            status, output = self.run_with("sh", "-c", f'{script} "$0"')
            self.assertEqual(status, 1, script)
            self.assertIn(why, output, script)

    def test_what_is_not_there_is_said(self):
        (self.folder / "refused" / "wrong.isv").unlink()
        self.assertIn("the stream is not there", self.run_with("cat")[1])
        self.assertIn("No such file", self.run_with("./no_such_decoder")[1])

    def test_streams_lose_the_frames_of_the_table(self):
        stream = (CONFORMANCE / "main_inter.isv").read_bytes()
        (self.folder / "lossy.isv").write_bytes(stream)
        packets = [stream[at:end] for at, end in packets_of(stream)]
        left = self.folder / "left"
        left.write_bytes(stream[:48] + packets[0] + packets[3])
        # Says what the table expects if it gets the frames that are left.
        script = f'cmp -s "$0" {left} && echo 0 0 {HASH} && echo 1 missing'
        for last, status in ("3 missing -", 0), (f"3 5 {HASH}", 1):
            (self.folder / "loss.txt").write_text(f"lossy.isv 1,2 0 0 {HASH}\nlossy.isv 1,2 {last}\n")
            found, output = self.run_with("--loss", "sh", "-c", script)
            self.assertEqual((found, "lossy.isv without 1,2" in output), (status, True), output)


if __name__ == "__main__":
    unittest.main()
