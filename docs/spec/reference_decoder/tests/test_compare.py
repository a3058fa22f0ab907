"""`conformance/compare` on decoders that say the same and others."""

import importlib.machinery
import importlib.util
import io
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from common import CONFORMANCE, load_command, packets_of

# A script without a suffix, of which nothing compiled is to stay behind.
sys.dont_write_bytecode = True
LOADER = importlib.machinery.SourceFileLoader("compare", str(CONFORMANCE / "compare"))
compare = importlib.util.module_from_spec(importlib.util.spec_from_loader("compare", LOADER))
LOADER.exec_module(compare)
command = load_command()


def hashes(stream):
    return [found for _, found in command.decode_stream(io.BytesIO(stream))]


class Compare(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def compare(self, one, other, *options):
        """Exit status and output."""
        decoders = [f"sh -c '{script}'" for script in (one, other)]
        command = [sys.executable, "-B", str(CONFORMANCE / "compare"), "--seed", "1", *options, *decoders, str(self.folder)]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        return done.returncode, done.stdout

    def test_the_same_output_agrees_and_another_differs(self):
        self.assertEqual(self.compare("echo", "echo")[0], 1, "no stream was compared")
        shutil.copy(CONFORMANCE / "main_inter.isv", self.folder)
        (self.folder / "no_stream").write_text("nothing")
        same = "echo 0 1; echo refused cut"
        status, output = self.compare(same, same)
        self.assertEqual((status, "1 agree" in output), (0, True), output)
        kept = self.folder / "kept"
        status, output = self.compare(same, "echo 0 1; echo refused damaged", "--keep", str(kept))
        self.assertEqual((status, "refused damaged" in output), (1, True), output)
        self.assertTrue((kept / "main_inter.isv.isv").is_file())
        self.assertEqual(self.compare(same, same + "; exit 3")[0], 1)

    def test_it_ends_in_time(self):
        shutil.copy(CONFORMANCE / "main_inter.isv", self.folder)
        start = time.monotonic()
        slow = "echo 0 1; exec sleep 60"
        status, output = self.compare(slow, "echo 0 1; echo 1 2", "--timeout", "0.5")
        self.assertEqual((status, " 1 for the time" in output), (0, True), output)
        status, output = self.compare(slow, "echo 0 1", "--seconds", "0.5")
        self.assertEqual((status, "no stream was compared" in output), (1, True), output)
        self.assertLess(time.monotonic() - start, 60)

    def test_who_says_less_needs_a_reason(self):
        for one, other, expected in [
            (["0 a", "1 b"], ["0 a", "1 b"], "agree"),
            (["0 a"], ["0 a", "1 b"], "differ"),
            (["0 a", "refused limit"], ["0 a", "1 b"], "limit"),
            (["0 a", "refused limit"], ["0 a", "refused cut"], "limit"),
            (["0 a", "refused limit"], ["0 c", "1 b"], "differ"),
            (["0 a", "1 b", "refused limit"], ["0 a"], "differ"),
        ]:
            self.assertEqual(compare.verdict([(one, True), (other, True)]), expected)
            self.assertEqual(compare.verdict([(other, True), (one, True)]), expected)
        self.assertEqual(compare.verdict([(["0 a"], False), (["0 a", "1 b"], True)]), "slow")
        self.assertEqual(compare.verdict([(["0 a", "1 b"], False), (["0 a"], True)]), "differ")
        self.assertEqual(compare.verdict([(["0 c"], False), (["0 a", "1 b"], True)]), "differ")

    def test_sealed_streams_decode_without_their_hashes(self):
        for name in "main_inter.isv", "main_quarter_vectors.isv", "paper_ends_edge_8.isv", "no_hashes_no_index.isv":
            stream = (CONFORMANCE / name).read_bytes()
            broken = bytearray(stream)
            for at, _ in packets_of(stream):
                broken[at + 20] ^= 1
            broken[44] ^= 1
            sealed = compare.sealed(bytes(broken))
            self.assertEqual(hashes(sealed), hashes(stream), name)
            self.assertFalse(any(sealed[at + 5] & 2 for at, _ in packets_of(sealed)), name)
            self.assertEqual(compare.sealed(sealed), sealed)
            for length in range(0, len(stream), 7):
                # The packet that is cut stays as it is.
                self.assertTrue(compare.sealed(stream[:length]).endswith(stream[length - 1 : length]), f"{name} cut to {length}")


if __name__ == "__main__":
    unittest.main()
