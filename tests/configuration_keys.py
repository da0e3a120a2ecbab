"""Keys of the configuration with the values that they take (test support)."""

from collections.abc import Iterator

from carillon.parameters.fields import Parameter, ValueDomain, parameters_of
from workflow.configuration.whole import whole


def every_key(model: type | None = None, prefix: str = "") -> Iterator[tuple[str, Parameter]]:
    """Every key; NAME stands for that of a solid or rule, [] for an entry of a list."""
    for name, each in parameters_of(model or whole()).items():
        yield f"{prefix}{name}", each
        for ending, domain in _parts(each.domain):
            if domain.is_section:
                yield from every_key(domain.kind, f"{prefix}{name}{ending}.")


def every_value() -> Iterator[tuple[str, ValueDomain]]:
    """Every value that is no section, entries of lists among them."""
    for place, each in every_key():
        for ending, domain in _parts(each.domain):
            if not domain.is_section:
                yield f"{place}{ending}", domain


def _parts(domain: ValueDomain) -> Iterator[tuple[str, ValueDomain]]:
    """A value and its entries, by what their names add to its own."""
    yield "", domain
    ending = ".NAME" if domain.kind is dict else "[]"
    for item in domain.items[:1]:
        yield from ((ending + further, each) for further, each in _parts(item))
