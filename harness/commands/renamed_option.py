"""Options that were renamed: the former name still works, but help shows only the new one."""

from typing import Any

import click

FORMER_TIMEOUT = "--patience"


class RenamedOption(click.Option):
    """An option whose first name is shown in help; the others are former names."""

    def get_help_record(self, ctx: click.Context) -> Any:
        names, self.opts = self.opts, self.opts[:1]
        try:
            return super().get_help_record(ctx)
        finally:
            self.opts = names
