"""Names that an attacker may give a file, a map or a class to do harm wherever they are shown."""

IMAGE = "<img src=x onerror=window.harmed=1>"
HOSTILE_NAMES = [
    IMAGE,
    '"><script>window.harmed=1<script>',
    "'\"`&lt;{{7*7}}${7*7}",
    "a$\\frac{$b_$^",
    "line\nbreak<b>",
    "\u202egnp.\u2066\u200f",
    "]]>--><svg onload=window.harmed=1>",
    "x" * 120,
]
