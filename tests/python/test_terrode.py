"""The Python module against the command line and against its own promises. Arguments: the program, the source folder."""
import json
import subprocess
import sys
import unittest

import numpy as np

import terrode

program, source = sys.argv[1:3]


def command(*arguments):
    return json.loads(subprocess.run([program, *arguments, "--json", "--quiet"], capture_output=True, check=True, text=True).stdout)


class SteadyWheel(unittest.TestCase):
    soil = dict(cohesion=139.28, friction_angle=0.606, shear_modulus=5.151e-4, k=2.541e5, n=1.387, plate_width=0.05)

    def test_answers_in_arrays_what_the_sweep_answers(self):
        slips = np.array([-0.7, 0.0, 0.3])
        wheel = terrode.SteadyWheel(0.13, 0.16, terrode.Soil(**self.soil), a0=0.18, a1=0.32)
        here = wheel.solve(slips, normal_load=115.0)
        there = command("sweep", f"{source}/scenarios/mms_table1.yaml", "--method", "steady", "--slip", "-0.7,0,0.3")
        for key in ("drawbar_pull", "driving_torque", "sinkage"):
            self.assertEqual(here[key].dtype, np.float64)
            # Relative 1e-6: the scenario writes its parameters with the digits of the paper's table.
            np.testing.assert_allclose(here[key], [p[key] for p in there["results"][0]["points"]], rtol=1e-6)

    def test_profile_carries_the_load(self):
        wheel = terrode.SteadyWheel(0.13, 0.16, terrode.Soil(**self.soil))
        p = wheel.profile(slip=0.3, normal_load=115.0, points=20001)
        load = 0.13 * 0.16 * np.trapz(p["sigma"] * np.cos(p["theta"]) + p["tau"] * np.sin(p["theta"]), p["theta"])
        # Trapezia on 20,000 intervals with a kink at theta_m: 1e-7 of the load.
        self.assertAlmostEqual(load, 115.0, delta=115.0 * 1e-6)

    def test_bad_input_names_the_key(self):
        with self.assertRaisesRegex(terrode.InputError, "cohesion"):
            terrode.Soil(**{**self.soil, "cohesion": -1.0})
        with self.assertRaises(ValueError):
            terrode.SteadyWheel(0.13, 0.16, terrode.Soil(**self.soil)).solve([1.5], normal_load=115.0)
        with self.assertRaises(terrode.RunError):
            terrode.SteadyWheel(0.13, 0.16, terrode.Soil(**self.soil)).solve([0.2], normal_load=1e7)


class Sweep(unittest.TestCase):
    def test_has_the_numbers_of_the_command(self):
        scenario = f"{source}/scenarios/ding2011.yaml"
        here = terrode.sweep(scenario, methods=["steady"], slips=np.array([0.1, 0.6]))["steady"]
        there = command("sweep", scenario, "--method", "steady", "--slip", "0.1,0.6")["results"][0]["points"]
        np.testing.assert_array_equal(here["slip"], [0.1, 0.6])
        for key in ("drawbar_pull", "driving_torque", "sinkage"):
            np.testing.assert_array_equal(here[key], [p[key] for p in there])
        self.assertEqual(here["error"], ["", ""])

    def test_a_missing_file_is_an_input_error(self):
        with self.assertRaisesRegex(terrode.InputError, "nowhere.yaml"):
            terrode.sweep("nowhere.yaml")


class Recordings(unittest.TestCase):
    def test_steady_values_are_those_of_the_table(self):
        r = terrode.load_recording(f"{source}/recordings/ding2011")
        self.assertEqual(len(r.runs), 6)
        self.assertAlmostEqual(r.wheel["radius"], 0.15735)
        pull = {run.condition["slip"]: run.steady["drawbar_pull"][0] for run in r.runs}
        self.assertEqual([pull[s] for s in sorted(pull)], [-6.5, 11.0, 14.5, 15.0, 15.0, 15.0])

    def test_diagnosis_is_that_of_the_command(self):
        recording = f"{source}/recordings/ding2011"
        here = terrode.diagnose(terrode.load_recording(recording))
        import tempfile
        with tempfile.TemporaryDirectory() as folder:
            there = command("diagnose", recording, "-o", folder)
        self.assertEqual(here["verdict"], there["verdict"])
        self.assertEqual([e["ids"] for e in here["effects"]], [e["ids"] for e in there["effects"]])
        self.assertEqual(here["fit"]["sinkage"]["heldout_rmse_after"], there["fit"]["sinkage"]["heldout_rmse_after"])


unittest.main(argv=sys.argv[:1])
