"""One page about a walk: the verdict in plain words first, then the evidence.

    figures    the figures of a cell, with their alternative texts
    svg        a figure as part of a page, in colours that the page chooses
    page       the page from its parts, in plain words, by the template in `templates`
    rendering  the page and its figures of a result, and as files
    cli        the command

The page requests nothing: it has no script, font or picture from elsewhere, and a content security
policy that forbids them.
"""
