"""Closed forms that judge the methods: one module a geometry, each with a test of its own.

``single_wave``     one wave, without adhesion (Westergaard) and with it (Johnson); the exact loop
``full_contact``    any profile in full contact
``periodic_punch``  Koiter's row of flat strips
``parabola``        JKR in plane strain
``wavy_parabola``   small-scale hysteresis inside one patch (after Guduru)
``exact_wave``      the single wave behind the contract of a method, as an oracle

Import from its modules.
"""
