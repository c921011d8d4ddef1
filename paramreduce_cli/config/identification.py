"""Settings of the identification from measured torques."""

from typing import Literal

from paramreduce_cli.fields.section import Name, Section


class IdentificationSection(Section):
    """The settings for identifying parameters from measured torques."""

    estimator: Literal["ordinary", "weighted", "robust"] = "weighted"
    """Least squares: plain; each joint weighted by the noise of its residuals; or besides with less weight for outliers (Huber)."""
    payloads: list[Name] = []
    """Payloads that are identified alone as well: with all other bodies at their values in this file, and drives where they have values."""
    consistency: Literal["euclidean", "entropic", "none"] = "euclidean"
    """Whether standard parameters that a machine can have are sought besides, and how their distance from the known ones is measured."""
