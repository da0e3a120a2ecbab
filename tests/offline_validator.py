"""rocrate-validator without the web: contexts of JSON-LD are read from a file (test support).

`python offline_validator.py CONTEXTS ARGUMENTS...`, by the Python that has roc-validator; CONTEXTS
is JSON, a context by its address.
"""

import io
import json
import sys
import urllib.request
from email.message import Message
from pathlib import Path
from urllib.response import addinfourl

import requests

KIND = "application/ld+json"


def main(contexts, arguments):
    """Run the validator where only these contexts can be loaded."""

    def sent(_, request, **how):
        response = requests.Response()
        response.request, response.url = request, request.url
        found = contexts.get(request.url)
        response.status_code = 404 if found is None else 200
        response.headers["Content-Type"] = KIND
        response._content = json.dumps(found).encode()
        return response

    def opened(request, *how, **more):
        address = getattr(request, "full_url", request)
        headers = Message()
        headers["Content-Type"] = KIND
        return addinfourl(io.BytesIO(json.dumps(contexts[address]).encode()), headers, address, 200)

    requests.adapters.HTTPAdapter.send = sent
    urllib.request.urlopen = opened
    from rdflib import _networking, parser
    from rocrate_validator.cli import cli

    _networking._urlopen = parser._urlopen = opened
    cli(arguments)


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text()), sys.argv[2:])
