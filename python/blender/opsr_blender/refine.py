"""A picture that gets better while nothing moves: what the viewport decides, without Blender."""

import time


class Refiner:
    """Renders a view until it, or the scene, changes.

    `export` makes a scene ready, `start` begins a render of a scene and a view, `read` reads its picture so far.
    """

    def __init__(self, export, start, read, quiet=0.25, clock=time.monotonic):
        self.export, self.start, self.read, self.quiet, self.clock = export, start, read, quiet, clock
        self.exported, self.view, self.running = None, None, None
        self.picture, self.message, self.pending = None, "", False
        self.moved = clock()

    def changed(self):
        """The scene is another one."""
        self.exported = None
        self.begin_again()

    def look(self, view):
        """The scene is seen so; the same view goes on."""
        if view != self.view:
            self.view = view
            self.begin_again()

    def begin_again(self):
        """Ends what runs; a render begins once nothing has moved for a while."""
        self.end()
        self.pending, self.moved = True, self.clock()

    def end(self):
        if self.running is not None:
            self.running.kill()
        self.running = None

    def tick(self):
        """Goes on; true if there is something new to draw."""
        if self.pending:
            return self.begin()
        if self.running is None:
            return False
        alive = self.running.running()
        is_new = self.running.fresh()
        if is_new:
            self.picture = self.read(self.running)
        self.message = self.running.status()
        if not alive:
            failed, _ = self.running.end()
            self.running, self.message = None, failed or ""
        return is_new or not alive

    def begin(self):
        if self.view is None or self.clock() - self.moved < self.quiet:
            return False
        self.pending = False
        try:
            if self.exported is None:
                self.exported = self.export()
            self.running = self.start(self.exported, self.view)
        except Exception as error:
            self.message = str(error)
            return True
        return False
