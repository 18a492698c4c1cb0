"""What is in a page of HTML that could run or be loaded."""

import base64
import hashlib
import re
from html.parser import HTMLParser

MARKUP = "<script>alert(1)</script><img src=x onerror=alert(1)>'\"&"
"""A text that must never become a part of a page."""


class Page(HTMLParser):
    """A page's own scripts, the hashes that its policy allows, what it loads or links to, and what else could run."""

    def __init__(self, text):
        super().__init__()
        self.scripts, self.hashes, self.loads, self.others, self.policy, self._inside = [], [], [], [], "", False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self._inside = tag == "script" and values.get("type") != "application/json" and "src" not in values
        self.scripts += [""] if self._inside else []
        self.loads += [values[name] for name in ("src", "href", "srcset", "data", "poster") if values.get(name)]
        self.others += [f"{tag} {name}" for name in values if name.startswith("on")]
        self.others += [tag] if tag in ("img", "iframe", "object", "embed", "base", "form", "link") else []
        if values.get("http-equiv") == "Content-Security-Policy":
            self.policy = values["content"]
            self.hashes = re.findall(r"'sha256-([^']+)'", self.policy)
            self.others += re.findall(r"script-src[^;]*'unsafe-[a-z]+'", self.policy)

    def handle_endtag(self, tag):
        self._inside = False

    def handle_data(self, data):
        if self._inside:
            self.scripts[-1] += data

    def runs_its_own_scripts_alone(self):
        own = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in self.scripts]
        return own == self.hashes and self.others == []
