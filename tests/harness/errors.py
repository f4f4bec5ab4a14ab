"""The fixture `error_of`, for errors that users see."""

import pytest

from rosy_addon.core.errors import RosyError


@pytest.fixture
def error_of():
    """A function that makes a call and returns the text of its RosyError, a single line."""

    def catch(function, *arguments, **keywords) -> str:
        with pytest.raises(RosyError) as caught:
            function(*arguments, **keywords)
        message = str(caught.value)
        assert "\n" not in message
        return message

    return catch
