import time
import urllib.error
import urllib.request

import pytest

import opsr


def test_films_are_pictures_in_notebooks(box):
    film = opsr.render(box, size=(16, 12), spp=16, table=0.3)
    for shown in (film, opsr.resolve(film)):
        png = shown._repr_png_()
        assert isinstance(png, bytes) and png.startswith(b"\x89PNG")
    plain = opsr.render(box, size=(16, 12), spp=1)
    assert plain._repr_png_() != film._repr_png_()


def test_view_shows_a_scene_until_it_is_closed(box):
    page = opsr.view(box, size=(16, 12), spp=1, table=0.3)
    assert page.address in page._repr_html_()
    assert "<canvas" in urllib.request.urlopen(page.address).read().decode()
    facts = urllib.request.urlopen(page.address + "facts").read().decode()
    assert "cornell_caustics" in facts
    page.close()
    for _ in range(100):
        try:
            urllib.request.urlopen(page.address, timeout=1)
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            break
        time.sleep(0.1)
    else:
        pytest.fail("the page is still there")


def test_view_refuses_what_cannot_be(box):
    with pytest.raises(ValueError, match="table"):
        opsr.view(box, table=2.0)
    with pytest.raises(TypeError):
        opsr.view(box, crop=(0, 0, 1, 1))
    with pytest.raises(TypeError):
        opsr.view(3)
