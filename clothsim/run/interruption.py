"""Interruption of a run by Ctrl-C: the step loop and Newton's method read the flag."""

from dataclasses import replace

from clothsim.base.interruption import InterruptFlag
from clothsim.run.session import Session
from clothsim.solve.newton.observer import Iterate, Observer
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.stepping import Watch


def interruptible(session: Session, flag: InterruptFlag) -> Session:
    """The session with the flag read at every iterate of every solve."""
    watch = session.integrator.watch

    def watched(step: int, dt: float, potential: Potential) -> Observer:
        flag.check()
        observe = watch(step, dt, potential)

        def observed(iterate: Iterate) -> None:
            flag.check()
            observe(iterate)

        return observed

    checked: Watch = watched
    return replace(session, integrator=replace(session.integrator, watch=checked))
