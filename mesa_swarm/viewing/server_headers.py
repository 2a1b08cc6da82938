"""What every answer of a server forbids the browser: to load from elsewhere, to be framed, to guess what a file is."""

import hashlib
from base64 import b64encode
from collections.abc import Mapping

# Nothing is permitted that a page does not list. A link that is followed does not hand on the address it came from.
NOTHING: Mapping[str, str] = {
    name: "'none'" for name in ("default-src", "object-src", "base-uri", "form-action", "frame-ancestors")
}
# A page may not refuse to be framed in its own text, only in a header: browsers complain of the attempt.
HEADER_ONLY = ("frame-ancestors",)
SAFE: Mapping[str, str] = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


def policy(sources: Mapping[str, str], in_page: bool = False) -> str:
    """Return a Content-Security-Policy (CSP level 3) that permits these sources by directive, and nothing else.

    In a page's ``meta`` element fewer directives count.
    """
    left_out = HEADER_ONLY if in_page else ()
    permitted = {**NOTHING, **sources}
    return "; ".join(f"{name} {source}" for name, source in permitted.items() if name not in left_out)


def safe_headers(sources: Mapping[str, str]) -> dict[str, str]:
    """Return the headers of every answer, errors and redirects included; sources are as in `policy`."""
    return {**SAFE, "Content-Security-Policy": policy(sources)}


def source_of(script: str) -> str:
    """Return the source that permits one inline script, and no other."""
    return f"'sha256-{b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
