"""The open-loop bounce by Siconos: Moreau and Jean's time stepping, Newton's impact law."""

import ctypes
import os
import subprocess
import sys
import tempfile

import siconos.kernel as kernel

import arm

STEP_S = 1e-4


def main(simulated_s):
    here = os.path.dirname(os.path.abspath(__file__))
    with tempfile.TemporaryDirectory() as folder:
        source, plugin = os.path.join(here, "plugin.c"), os.path.join(folder, "plugin.so")
        flags = ["-O2", "-shared", "-fPIC", "-Wl,-soname,plugin.so"]
        subprocess.run(["cc", *flags, "-o", plugin, source, "-lm"], check=True)
        # Siconos finds a loaded library by its name.
        ctypes.CDLL(plugin, mode=ctypes.RTLD_GLOBAL)
        theta1, theta2 = arm.start()
        system = kernel.LagrangianDS([theta1, theta2], [0.0, 0.0], "plugin:mass")
        system.setComputeFIntFunction("plugin", "internal")
        law = kernel.NewtonImpactFrictionNSL(arm.RESTITUTION, 0.0, arm.FRICTION, 2)
        relation = kernel.LagrangianRheonomousR("plugin:gap", "plugin:gap_q", "plugin:gap_t")
        interaction = kernel.Interaction(law, relation)
        model = kernel.NonSmoothDynamicalSystem(0.0, simulated_s)
        model.insertDynamicalSystem(system)
        model.link(interaction, system)
        simulation = kernel.TimeStepping(
            model,
            kernel.TimeDiscretisation(0.0, STEP_S),
            kernel.MoreauJeanOSI(0.5),
            kernel.FrictionContact(2),
        )
        report = arm.Report()
        was_touching, steps = True, 0
        while simulation.hasNextEvent():
            simulation.computeOneStep()
            gap, impulse = interaction.y(0)[0], interaction.lambda_(1)[0]
            report.see(system.velocity()[0], gap)
            is_touching = impulse > 0
            if is_touching and not was_touching:
                report.touch(steps * STEP_S)
            was_touching = is_touching
            simulation.nextStep()
            steps += 1
        report.write(steps * STEP_S, "", f"Moreau-Jean, Newton's law with e = {arm.RESTITUTION}, steps of {STEP_S * 1e3:g} ms")


main(float(sys.argv[1]))
