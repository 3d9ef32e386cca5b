"""One page that tells a walk: the verdict in plain words first, then what it rests on.

    words     verdicts, advice and quantities in plain words
    seen      what each picture shows, in words
    figures   the pictures of a cell
    svg       a picture as part of a page, in colours that the page gives it
    page      the page from its parts, by the template in `templates`
    writing   the page and its pictures to files
    cli       the command

The page asks nobody for anything: no script, no font, no picture from elsewhere, and a policy in it
that says so.
"""
