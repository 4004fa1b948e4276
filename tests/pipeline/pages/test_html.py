from semidense.pipeline.pages.html import folded, table, tag, text


def test_no_text_becomes_markup() -> None:
    evil = "<script>alert(1)</script>"
    page = text(evil) + tag("p", class_=f'"{evil}') + table([evil], [[evil]], caption=evil) + folded(evil)
    assert "<script" not in page
    assert 'class="&quot;' in page


def test_numbers_stand_at_the_right() -> None:
    assert '<td class="number">1</td>' in table(["scene", "n"], [["a", 1]], caption="c")
    assert '<th class="word">a</th>' in table(["scene", "n"], [["a", 1]], caption="c")
