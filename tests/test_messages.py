"""Every message of the table is the one that was read last; whole sentences are held here and nowhere else."""

from __future__ import annotations

import pytest

from tests.messages import FILE, text_of_all


def test_the_messages_are_those_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    now, kept = (text.split("\n== ") for text in (text_of_all(), FILE.read_text(encoding="utf-8")))
    assert len(kept) > 200
    changed = [one for one in now if one not in kept]
    assert now == kept, "renew them: python -m tests.messages\n\n" + "\n".join(changed)
