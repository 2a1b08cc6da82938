"""The part `fields`: scalar fields by name, which advance after contacts are resolved."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple
from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, shortened
from mesa_swarm.geometry.diffusion import FieldBlocks, advance_fields
from mesa_swarm.kernels.block import Block, stack_blocks
from mesa_swarm.kernels.part import Column, Context, Itself, Kernel, Part, Phase, Prepared, Stage
from mesa_swarm.world.fields import Field, NamedFields, ScalarField
from mesa_swarm.world.shapes import Shape


class FieldsPart(Part):
    """The scalar fields of a model.

    Attributes
    ----------
    live : dict of str to ScalarField
        In the order in which they were added; replaced when one is added or removed.
    """

    name = "fields"
    first = ("declared",)

    def __init__(self, model: Any) -> None:
        self.model, self.cache = model, Prepared()
        self.live: dict[str, ScalarField] = {}

    def bind(self, context: Context) -> None:
        """Let fields look at their values again, which may have been written."""
        for field in self.live.values():
            field.restore(field.checkpoint())
        self._renew_kernel()

    def columns(self) -> Mapping[str, Column]:
        """Return the values of each field."""
        return {name: Column(field.checkpoint()["values"]) for name, field in self.live.items()}

    def stages(self) -> Iterator[Stage]:
        """Advance all fields, if there are any."""
        if self.live:
            yield Stage(Phase.PROCESS, self.advance, "fields diffuse and evaporate", self.kernel())

    def parameters(self) -> list[Field]:
        """Return the declarations of all fields."""
        return [field.declaration for field in self.live.values()]

    def mark(self) -> dict[str, Any]:
        """Return how often values of fields were changed other than by advancing, and which fields there are."""
        changes = [field.changes for field in self.live.values()] if self.live else ()
        return {"values of fields": changes, "fields": Itself(self.live)}

    def store(self) -> dict[str, Any]:
        """Return the declarations of all fields, and the largest values that they had."""
        return {
            "declared": [list(astuple(field.declaration)) for field in self.live.values()],
            "peaks": [field.peak for field in self.live.values()],
        }

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned; fields that the model has stay the same objects."""
        if "declared" in stored:
            self._declare([Field(*values) for values in stored["declared"]])
        for field, peak in zip(self.live.values(), stored.get("peaks", ()), strict=False):
            field.restore({**field.checkpoint(), "peak": peak})

    def _declare(self, fields: Sequence[Field]) -> None:
        before, self.live = self.live, {}
        for field in fields:
            field_state = before.get(field.name)
            if field_state is None or field_state.declaration != field:
                field_state = self.add_field(field)
            self.live = {**self.live, field.name: field_state}
        for earlier in before.values():
            earlier.removed = self.live.get(earlier.name) is not earlier
        self._renew_kernel()

    def advance(self) -> None:
        """Advance all fields by a step."""
        if self.live:
            self.kernel().run(self.model.steps, len(self.model.swarm))

    def kernel(self) -> Kernel:
        """Return what advances all fields, made anew when these or their walls have changed."""
        if self.cache.kernel is None:
            blocks = [field.block() for field in self.live.values()]
            rows = stack_blocks(blocks)
            every = Block(FieldBlocks(rows))
            self.cache.kernel = Kernel(advance_fields, every.numbers, (every, blocks))
        return self.cache.kernel

    def _renew_kernel(self) -> None:
        """Let the kernel be made anew."""
        self.cache.kernel = None
        self.model.parts.replan()

    def walls_changed(self) -> None:
        """Let fields find anew what stops them."""
        for field in self.live.values():
            field.walls_changed()
        self._renew_kernel()

    def named(self) -> NamedFields:
        """Return the fields by name, to be read only."""
        return NamedFields(self.live)

    def add_field(self, field: Field) -> ScalarField:
        """Add a scalar field, empty at first, and return it; it advances in each step, after contacts are resolved.

        Raises
        ------
        InvalidValueError
            If the model has a field of this name, or it would have too many cells or sub-steps.

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> trail = model.add_field(Field("trail", cell=10.0, diffusion=0.1, evaporation=0.01))
        >>> trail.deposit((400, 300), 5.0)
        >>> round(model.run(1).fields["trail"].total, 3)
        4.95
        """
        if not isinstance(field, Field):
            raise InvalidValueError(f'field is {shortened(field)}; expected a Field such as Field("trail")')
        if field.name in self.live:
            raise InvalidValueError(f"the model has a field {field.name} already; expected another name")
        live = ScalarField(field, self.model.map.bounds, self._walls)
        self.live = {**self.live, field.name: live}
        self._renew_kernel()
        return live

    def remove_field(self, name: str) -> ScalarField:
        """Take a scalar field out of the model, between two steps, and return it with its last values.

        Rows of a recording have no picture of it from then on.

        Raises
        ------
        UnknownNameError
            If the model has no field of this name.
        InvalidValueError
            If a robot has a sensor or an actuator for it.

        Examples
        --------
        >>> from mesa_swarm import Field, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> trail = model.add_field(Field("trail"))
        >>> trail.deposit((400, 300), 5.0)
        >>> model.remove_field("trail").total, len(model.fields)
        (5.0, 0)
        """
        field = self.named()[name]
        self._check_unused(field.name)
        self.live, field.removed = {other: live for other, live in self.live.items() if live is not field}, True
        self._renew_kernel()
        return field

    def _check_unused(self, name: str) -> None:
        """Refuse the name of a field that a sensor or an actuator of a robot is about."""
        designs, column = self.model.swarm.designs, self.model.swarm.columns["design"]
        for place in np.unique(column).tolist():
            for device in (*designs[place].sensors, *designs[place].actuators):
                if getattr(device, "field", None) == name:
                    robots = int((column == place).sum())
                    raise InvalidValueError(
                        f"field {name} is used by {type(device).__name__} {device.name} of {robots} robots; "
                        "remove these robots first"
                    )

    def _walls(self) -> list[Shape]:
        """Return the shapes of what stops fields: solid bodies that do not move."""
        return [body.shape for body in self.model.parts.bodies.listed if body.mode == "fixed" and body.contact]
