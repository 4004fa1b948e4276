import numpy as np

from semidense.pipeline.files.map_pictures import confidence_picture, disparity_picture

YELLOW, BLACK, WHITE = [253, 231, 36], [0, 0, 0], [255, 255, 255]


def test_every_pixel_of_the_map_is_one_of_the_picture() -> None:
    disparity = np.full((480, 600), 60, np.float32)
    disparity[:, :300] = 10
    disparity[5, 7] = np.nan
    picture = disparity_picture(disparity, "a title")
    assert picture.shape == (36 + 480 + 36, 600 + 7 * 12, 3) and picture.dtype == np.uint8
    shown = picture[36 : 36 + 480, 12 : 12 + 600]
    assert (shown[:, 300:] == YELLOW).all()
    assert shown[5, 7].tolist() == BLACK
    assert (shown[:5, :300] == shown[0, 0]).all() and shown[0, 0].tolist() not in (YELLOW, BLACK)


def test_the_bar_goes_from_the_highest_value_at_the_top_to_the_lowest() -> None:
    disparity = np.repeat(np.float32([[10], [60]]), 240, axis=0).repeat(600, axis=1)
    picture = disparity_picture(disparity, "a title")
    bar = picture[36 : 36 + 480, 12 + 600 + 12]
    assert bar[0].tolist() == YELLOW
    assert bar[-1].tolist() == picture[36, 12].tolist(), "the colour of 10 px"


def test_a_small_map_is_enlarged_by_a_whole_number() -> None:
    confidence = np.float32([[0, 1], [np.nan, 1]])
    picture = confidence_picture(confidence, "a title")
    assert picture[36, 12].tolist() == picture[36 + 239, 12 + 239].tolist()
    assert picture[36 + 240, 12].tolist() == BLACK
    assert picture[36, 12 + 240].tolist() not in (BLACK, WHITE, picture[36, 12].tolist())


def test_a_long_title_takes_more_lines_above_the_map() -> None:
    confidence = np.ones((480, 480), np.float32)
    heights = [len(confidence_picture(confidence, "word " * words)) for words in (3, 30, 60)]
    assert heights[0] < heights[1] < heights[2]
    assert len({height % 18 for height in heights}) == 1, "whole lines of 18 px"


def test_a_map_without_any_value_is_black() -> None:
    picture = disparity_picture(np.full((480, 500), np.nan, np.float32), "nothing")
    assert not picture[36 : 36 + 480, 12 : 12 + 500].any()


def test_what_black_means_is_told_only_where_there_is_some() -> None:
    confidence = np.full((480, 500), 0.5, np.float32)
    below = confidence_picture(confidence, "a title")[36 + 480 + 6 :, : 12 + 500]
    assert (below == 255).all()
    confidence[0, 0] = np.nan
    assert not (confidence_picture(confidence, "a title")[36 + 480 + 6 :, : 12 + 500] == 255).all()


def test_the_bar_of_a_confidence_is_one_of_log_odds() -> None:
    confidence = np.repeat(np.float32([[0.9, 0.1]]), 480, axis=0).repeat(240, axis=1)
    picture = confidence_picture(confidence, "a title")
    bar = picture[36 : 36 + 480, 12 + 480 + 12].astype(int)
    # ln 9 / ln 99 = 0.478 of the way from the middle to an end
    for column, row in ((12, 240 - 115), (12 + 300, 240 + 115)):
        assert abs(bar[row - 1 : row + 2] - picture[40, column]).sum(axis=1).min() <= 6
