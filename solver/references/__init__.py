"""Closed-form solutions to validate the methods: one module per geometry.

``single_wave``     one wave, without adhesion (Westergaard) and with it (Johnson); the exact loop
``full_contact``    any profile in full contact
``periodic_punch``  Koiter's row of flat strips
``parabola``        JKR in plane strain

Import from its modules.
"""
