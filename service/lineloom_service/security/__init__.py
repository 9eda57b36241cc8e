"""Who may do what: bearer tokens, their scopes, and what protects browsers.

`token` is a token's form, `scopes` what each route asks for, `guard` decides, `headers` are for
browsers, `token_book` is the table behind `lineloom token`.
"""
