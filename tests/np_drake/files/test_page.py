"""Laws of the one page builder."""

import pytest

from np_drake.files.page import Section, write_page


@pytest.fixture
def section(tmp_path):
    template = tmp_path / "section.html.j2"
    template.write_text(
        '{{ picture("a", "alt", "What is seen") }}{{ table(["name", "size"], rows, numbers=1) }}'
        "{{ items(said) }}"
    )
    return Section(template, {"rows": [("<x>", "3 cm")], "said": ["one"]})


def test_a_page_holds_sections_pictures_and_style_and_asks_no_network(section, tmp_path):
    text = write_page(tmp_path / "p.html", "Title", [section, section], {"a": b"1"}).read_text()
    assert "<title>Title</title>" in text
    assert text.count("data:image/png;base64,MQ==") == 2
    assert "<b>&lt;x&gt;</b>" in text  # what is shown is no markup
    assert '<td class="n"><span>3\N{NO-BREAK SPACE}cm</span>' in text
    assert "<li>one</li>" in text
    assert "default-src 'none'" in text
    assert ":root" in text
    assert (tmp_path / "a.png").read_bytes() == b"1"


def test_figures_of_a_dark_page_are_dark_and_printed_ones_light(section, tmp_path):
    text = write_page(tmp_path / "p.html", "Title", [section], {"a": b"1"}).read_text()
    dark = text.split("prefers-color-scheme: dark")[1].split("\n}")[0]
    assert "figure img { filter: invert" in dark
    assert "filter: none" in text.split("@media print")[1]


def test_a_picture_of_an_earlier_run_is_gone_from_page_and_folder(section, tmp_path):
    (tmp_path / "a.png").write_text("earlier")
    text = write_page(tmp_path / "p.html", "Title", [section], {"a": None}).read_text()
    assert "<figure>" not in text
    assert not (tmp_path / "a.png").exists()
