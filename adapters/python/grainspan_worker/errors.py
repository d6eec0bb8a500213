"""Why a trial or a definition is refused. The committed state is unchanged in every case.

Each error knows its form on the wire: MessagePack of ``{variant: contents}``, or of the bare name of a variant without
contents.
"""


class RveError(Exception):
    """An error that travels to the run. Use one of the subclasses."""

    def wire(self):
        """What is encoded as MessagePack."""
        return {"EngineFault": str(self)}


class TargetNotFinite(RveError):
    """NaN or infinity in the target."""

    def __init__(self):
        super().__init__("the target deformation is not finite")

    def wire(self):
        return "TargetNotFinite"


class TargetInverted(RveError):
    """``det F <= 0``."""

    def __init__(self, determinant):
        super().__init__(f"the target deformation turns the cell inside out: det F = {determinant:.6e}")
        self.determinant = float(determinant)

    def wire(self):
        return {"TargetInverted": [self.determinant]}


class TargetTooLarge(RveError):
    """The target is farther than the engine accepts in one trial; smaller steps help."""

    def __init__(self, norm, limit):
        super().__init__(f"the target deformation |H| = {norm:.3e} exceeds the limit {limit:.3e} of one trial")
        self.norm, self.limit = float(norm), float(limit)

    def wire(self):
        return {"TargetTooLarge": [self.norm, self.limit]}


class StepTooLarge(RveError):
    """The engine takes no step as large as this one; the text says why, and smaller steps help."""

    def wire(self):
        return {"StepTooLarge": str(self)}


class NotFinite(RveError):
    """The solver produced NaN or infinity; smaller steps may help."""

    def __init__(self, force_evaluations):
        super().__init__(f"a value is not finite after {force_evaluations} force evaluations")
        self.force_evaluations = int(force_evaluations)

    def wire(self):
        return {"NotFinite": [self.force_evaluations]}


class NotEquilibrated(RveError):
    """The grains did not come to rest within the step cap; smaller steps may help."""

    def __init__(self, strain, asked, increments, of, unbalanced, tolerance, force_evaluations):
        super().__init__(
            f"the grains did not come to rest: strain {strain:.3e} of {asked:.3e} applied in {increments} of {of} "
            f"increments, unbalanced {unbalanced:.2e} against a tolerance of {tolerance:.2e} after "
            f"{force_evaluations} force evaluations"
        )
        self.contents = [
            float(strain),
            float(asked),
            int(increments),
            int(of),
            float(unbalanced),
            float(tolerance),
            int(force_evaluations),
        ]

    def wire(self):
        return {"NotEquilibrated": self.contents}


class Unsupported(RveError):
    """The engine cannot deliver what was asked; the text completes "... is not supported by this engine"."""

    def wire(self):
        return {"Unsupported": str(self)}


class DefinitionRefused(RveError):
    """The definition does not describe an RVE that this engine can build."""

    def wire(self):
        return {"Definition": str(self)}


class SnapshotRefused(RveError):
    """A snapshot was refused: damaged, of another engine, or of another definition."""

    def wire(self):
        return {"Snapshot": str(self)}


class EngineFault(RveError):
    """The engine broke down: its defect, not that of the request."""


class MessageTooLarge(Exception):
    """A message does not fit the channel."""
