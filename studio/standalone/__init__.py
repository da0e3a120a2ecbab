"""One page of a finished design that needs no server: to be turned, struck and compared."""

from studio.standalone.page import write_page
